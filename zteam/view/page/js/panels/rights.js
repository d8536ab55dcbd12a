/** Whether this page may command, and if not, why and how it may. */

/** @param {import("../store.js").Store} store @returns {string} "" if it may */
export function whyNoCommand({ connection }) {
  if (connection.state !== "open") return "not connected to the view's server";
  if (!connection.mayCommand) return "watching only: open the address with #token=… that zteam printed";
  return "";
}
