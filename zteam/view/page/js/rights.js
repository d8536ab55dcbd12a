/** Whether this page may command, and if not, why and how it may. */

import { WATCHING } from "./connection.js";
import { chosenRobots } from "./tools/pose.js";

const RECORDED = "a recording is shown, which takes no commands";

/** @param {import("./store.js").Store} store @returns {string} why robots and world take no commands of it; "" if they do */
export const whyNoCommand = (store) => whyNoRight(store) || (store.isRecorded ? RECORDED : "");

/** @param {import("./store.js").Store} store @returns {string} why the server takes none; "" if it does */
export function whyNoRight({ connection }) {
  if (connection.state !== "open") return "not connected to the view's server";
  return connection.mayCommand ? "" : WATCHING;
}

/** Why a tool cannot work now, for these robots or for any; "" if it can. @param {import("./app.js").App} app @param {string} name */
export function whyNoTool(app, name) {
  if (["select", "measure"].includes(name)) return "";
  const { store } = app, { team } = store, why = whyNoCommand(store);
  if (why || !team) return why;
  const grant = name === "goal" || name === "pose" ? "goals" : name === "drive" ? "teleop" : "";
  if (team.refused?.includes(grant)) {
    return `the certificate of this view lacks the grant ${grant}: write 'view = ["goals", "teleop"]' below [security.grants] of the team file`;
  }
  if (name !== "goal") return "";
  const chosen = chosenRobots(app), robots = team.robots.filter(({ id }) => !chosen.length || chosen.includes(id));
  if (!robots.length || robots.some((robot) => robot.takes_goals)) return "";
  const named = chosen.length ? robots.map((robot) => robot.name).join(", ") : "these robots";
  return `nothing takes goals for ${named}: use navigation, or a behaviour such as go_to`;
}
