/** Starts the page. */

import { App } from "./app.js";
import { takeToken } from "./connection.js";
import { Driver } from "./drive/driver.js";
import { listenToGamepads } from "./drive/gamepad.js";
import { listenToDriveKeys } from "./drive/keyboard.js";
import { mountStick } from "./drive/stick.js";
import { makeScene } from "./scene/scene.js";
import { mountStop } from "./stop.js";
import { mountTools } from "./tools/tools.js";

const app = new App();
const stats = { frames: 0, js_ms: [], arrival_ms: [], age_ms: [], bytes: 0 };
/** For tests, benchmarks and the browser's console. */
/** @type {any} */ (window).zteam = { app, stats };

const element = /** @type {HTMLElement} */ (document.querySelector("#scene"));
app.scene = makeScene(app, element, stats);
app.drive = new Driver(app);
mountStop(app, /** @type {HTMLElement} */ (document.querySelector("#stop")));
mountTools(app, element, /** @type {HTMLElement} */ (document.querySelector("#tools")));
listenToDriveKeys(app.drive);
listenToGamepads(app.drive);
mountStick(app.drive, element);
app.connection.open();
// Over a slow link the map comes before what is beside it.
import("./panels/main.js")
  .then(({ mountPanels }) => mountPanels(app))
  .catch((error) => {
    console.error(error);
    /** @type {HTMLElement} */ (document.querySelector("#notice")).textContent = "The panels could not be loaded. Reload the page.";
  });
// The address that zteam prints may be entered where the page is open already.
addEventListener("hashchange", () => {
  const token = takeToken();
  if (token) app.connection.useToken(token);
});
