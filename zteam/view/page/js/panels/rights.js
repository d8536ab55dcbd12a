/** Whether this page may command, and if not, why and how it may. */

import { WATCHING } from "../connection.js";

/** @param {import("../store.js").Store} store @returns {string} "" if it may */
export function whyNoCommand({ connection }) {
  if (connection.state !== "open") return "not connected to the view's server";
  return connection.mayCommand ? "" : WATCHING;
}
