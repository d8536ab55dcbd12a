/** Panels beside the map. */

/** @param {import("../app.js").App} _app */
export function mountPanels(_app) {}
