/** Starts the page. */

import { App } from "./app.js";
import { mountPanels } from "./panels/main.js";

const app = new App();
/** For tests, benchmarks and the browser's console. */
/** @type {any} */ (window).zteam = { app, stats: { frames: 0, js_ms: [], age_ms: [], bytes: 0 } };
mountPanels(app);
app.connection.open();
