/** What the page uses of uPlot (vendor/uplot, MIT): charts whose axes have units. */

import uPlot from "../vendor/uplot/uPlot.esm.js";

/** @typedef {{draw: (tables: [number[], number[]][], width: number, height: number) => void, remove: () => void}} Chart */

/**
 * @param {HTMLElement} place
 * @param {string} unit of the values, "" if it is unknown
 * @param {{topic: string, field: string, color: string, dash: number[]}[]} series
 * @param {() => [number, number]} range of the time axis, s
 * @param {(seconds: number) => string} timeText
 * @returns {Chart}
 */
export function makeChart(place, unit, series, range, timeText) {
  const style = getComputedStyle(document.documentElement);
  const color = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const size = parseFloat(style.fontSize) / 16, scaled = (/** @type {number} */ pixels) => Math.round(pixels * size);
  const font = `${scaled(11)}px system-ui, sans-serif`;
  const axis = { stroke: color("--muted"), grid: { stroke: color("--line"), width: 1 }, ticks: { stroke: color("--line"), width: 1, size: 4 }, font, labelFont: font };
  const chart = new uPlot({
    width: 100,
    height: 100,
    // To the right of the last time is half of its text.
    padding: [null, scaled(18), null, null],
    legend: { show: false },
    cursor: { y: false, drag: { setScale: false } },
    scales: { x: { time: false, range }, y: { range: (_chart, low, high) => rangeOf(low, high) } },
    axes: [
      { ...axis, size: scaled(26), values: (_chart, times) => times.map(timeText) },
      { ...axis, size: scaled(52), labelSize: scaled(16), label: unit || "value" },
    ],
    series: [{}, ...series.map(({ topic, field, color: stroke, dash }) => ({ label: `${topic} ${field}`, stroke, dash, width: 1.5, spanGaps: true, points: { show: false } }))],
  }, [[], ...series.map(() => [])], place);
  return {
    draw(tables, width, height) {
      if (chart.width !== width || chart.height !== height) chart.setSize({ width, height });
      const filled = tables.map((table) => /** @type {uPlot.AlignedData} */ (table));
      chart.setData(filled.length === 1 ? filled[0] : uPlot.join(filled));
    },
    remove: () => chart.destroy(),
  };
}

/** The range of the value axis: a value that stays the same is in its middle. @param {number | null} low @param {number | null} high @returns {[number, number]} */
function rangeOf(low, high) {
  if (low === null || high === null) return [-1, 1];
  if (low === high) return [low - (Math.abs(low) / 10 || 1), low + (Math.abs(low) / 10 || 1)];
  const [start, end] = uPlot.rangeNum(low, high, 0.1, true);
  return [start ?? low, end ?? high];
}
