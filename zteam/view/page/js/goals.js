/** Goals of robots: which ones last, what is said of them, and how they are given up. */

const LIVE = new Set(["sent", "planning", "driving", "recovering"]);
const NAMED = 3;

/**
 * @typedef {{robot: number, x: number, y: number, yaw: number, stamp: number, state: string, distance: number | null,
 *   seconds: number | null, recoveries: number, text: string}} Goal stamp: ns; metres and seconds that are left
 */

/** @param {Goal} goal @returns {boolean} whether its robot is still on the way */
export const isLive = (goal) => LIVE.has(goal.state);

/** @param {import("./store.js").Store} store @returns {Goal[]} those that last, by robot */
export function liveGoals(store) {
  return (store.docs.goals ?? []).filter(isLive);
}

/** How far it is: `3.2 m · 8 s`; the state where that is not known, and any state but driving. @param {Goal} goal */
export function progressText({ state, distance, seconds, recoveries }) {
  const parts = state === "driving" && distance !== null ? [] : [state];
  if (distance !== null) parts.push(`${distance.toFixed(1)} m`);
  if (seconds !== null) parts.push(seconds < 120 ? `${seconds} s` : `${Math.round(seconds / 60)} min`);
  if (recoveries) parts.push(recoveries === 1 ? "1 recovery" : `${recoveries} recoveries`);
  return parts.join(" · ");
}

/** @param {import("./app.js").App} app @param {number[]} robots @param {boolean} pauses whether lists send no next goal */
export const cancelGoals = (app, robots, pauses = false) => app.ask({ op: "cancel", robots, pauses }, "Cancel");

/** @param {import("./store.js").Store} store @returns {string[]} the robots whose lists of goals are paused, by name */
export function pausedLists({ team }) {
  return Object.entries(team?.lists ?? {}).flatMap(([robot, paused]) => (paused ? [`robot_${robot}`] : []));
}

/** Says in a message how each goal ends, from now on. @param {import("./app.js").App} app */
export function tellEnds(app) {
  const { store } = app;
  /** @type {Map<number, Goal> | null} by robot; null before the first document */
  let known = null;
  let since = 0;
  store.on("connection", ({ state }) => {
    if (state !== "open") known = null;
  });
  store.on("goals", (/** @type {Goal[]} */ goals) => {
    const before = known;
    known = new Map(goals.map((goal) => [goal.robot, goal]));
    if (before === null) since = 1e9 * store.frame.stamp;
    else {
      say(app, goals.filter((goal) => hasEnded(goal, before.get(goal.robot), since)));
      const lost = [...before.values()].filter((goal) => isLive(goal) && !known?.has(goal.robot) && store.robots.get(goal.robot)?.present);
      for (const { robot } of lost) app.say(`robot_${robot} lost its goal: the process that drove it was restarted`, "error");
    }
  });
}

/** ms within which a robot that takes a goal has it, and metres between two places of one goal. */
const TAKEN = [800, 6000],
  SAME = 0.05;

/** Says that a goal has ended of which no end was seen, because a list sent the next one at once.
 * @param {import("./app.js").App} app @param {number} robot @param {number} x @param {number} y of a goal that is sent now */
export function watchGoal(app, robot, x, y) {
  const begun = performance.now();
  const end = app.store.on("goals", (/** @type {Goal[]} */ goals) => {
    const goal = goals.find((one) => one.robot === robot), passed = performance.now() - begun;
    const isOther = goal !== undefined && isLive(goal) && Math.hypot(goal.x - x, goal.y - y) > SAME;
    if (passed < TAKEN[0] || (!isOther && passed < TAKEN[1] && goal && isLive(goal))) return;
    end();
    if (isOther && passed < TAKEN[1]) app.say(`robot_${robot} drives to another goal now, perhaps of a list: how yours ended is in the log`, "error");
  });
}

/**
 * @param {Goal} goal
 * @param {Goal | undefined} before the robot's goal in the document before
 * @param {number} since when the first document came, ns: what had ended before is no news
 */
function hasEnded(goal, before, since) {
  if (isLive(goal)) return false;
  return before ? isLive(before) || before.stamp !== goal.stamp : goal.stamp >= since;
}

/** @param {import("./app.js").App} app @param {Goal[]} ended */
function say(app, ended) {
  for (const [state, one, many] of [
    ["succeeded", "reached its goal", "reached their goals"],
    ["canceled", "stops: its goal is canceled", "stop: their goals are canceled"],
  ]) {
    const names = ended.filter((goal) => goal.state === state).map(({ robot }) => `robot_${robot}`);
    if (names.length === 1) app.say(`${names[0]} ${one}`);
    else if (names.length) app.say(`${names.length > NAMED ? `${names.length} robots` : names.join(", ")} ${many}`);
  }
  for (const { robot, text } of ended.filter((goal) => goal.state === "aborted")) {
    app.say(`robot_${robot} gave up its goal${text ? `: ${text}` : ""}`, "error");
  }
}
