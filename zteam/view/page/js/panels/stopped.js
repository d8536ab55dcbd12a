/** Above the map, while robots are stopped: which, that nothing drives them, and the way to release them. */

import { confirmButton, el, setText } from "../dom.js";
import { whyNoCommand } from "../rights.js";

const NAMED = 6;

/** @param {{name: string}[]} robots */
function namesOf(robots) {
  const named = robots.slice(0, NAMED).map(({ name }) => name).join(", ");
  return robots.length > NAMED ? `${named} and ${robots.length - NAMED} more` : named;
}

/** What is said of the robots that are stopped; "" if none is. @param {import("../store.js").Robot[]} robots @returns {string} */
export function stoppedText(robots) {
  const held = robots.filter(({ stopped }) => stopped), unheld = robots.filter((robot) => robot.unheld);
  if (!held.length) return "";
  const all = robots.every((robot) => robot.stopped || !robot.present);
  const said = all ? "All robots stand, whatever drives them." : `${namesOf(held)} ${held.length === 1 ? "stands, whatever drives it" : "stand, whatever drives them"}.`;
  return unheld.length ? `${said} Not held: ${namesOf(unheld)}, a base without a robot process.` : said;
}

/** @param {import("../app.js").App} app */
export function mountStopped(app) {
  const { store } = app;
  const text = el("span", { class: "grow", role: "status" });
  const release = confirmButton("Release", "Click again to release", () => app.ask({ op: "release_robots" }, "Not every robot is released"));
  const card = el("div", { class: "card stopped", hidden: true, "aria-label": "Stopped" }, el("strong", { class: "bad" }, "Stopped"), text, release);
  document.getElementById("notice")?.prepend(card);
  const show = () => {
    const said = stoppedText(store.team?.robots ?? []), why = whyNoCommand(store);
    card.hidden = said === "" || store.connection.state !== "open";
    setText(text, said);
    release.disabled = why !== "";
    release.title = why || "Let the robots go on with what they were about";
  };
  for (const event of ["team", "connection"]) store.on(event, show);
  show();
}
