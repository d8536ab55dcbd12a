/** What this browser keeps for the page. Some allow no page to keep anything. */

/** @param {string} key @returns {string} "" if nothing is kept */
export function recall(key) {
  try {
    return localStorage.getItem(key) ?? "";
  } catch {
    return "";
  }
}

/** @param {string} key @param {string} text "" forgets it */
export function keep(key, text) {
  try {
    if (text) localStorage.setItem(key, text);
    else localStorage.removeItem(key);
  } catch {
    // It holds for this page only.
  }
}
