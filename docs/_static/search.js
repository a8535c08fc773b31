// Below each result of a search, the words around what was found, from searchtexts.js: also in a site on a disk.
"use strict";
const AROUND = 240;
function excerpt(text, words) {
  const lower = text.toLowerCase();
  const places = words.map((word) => lower.indexOf(word)).filter((place) => place >= 0);
  const from = Math.max((places.length ? Math.min(...places) : 0) - AROUND / 3, 0);
  const part = text.slice(from, from + AROUND).trim();
  return (from > 0 ? "…" : "") + part + (from + AROUND < text.length ? "…" : "");
}
function textOf(link) {
  const url = new URL(link.href);
  const names = Object.keys(PAGE_TEXTS).filter((name) => url.pathname.endsWith(`/${name}.html`));
  const found = names.length ? PAGE_TEXTS[names.sort((a, b) => b.length - a.length)[0]] : [];
  const section = found.find(([id]) => `#${id}` === url.hash);
  return section && section[1] ? section[1] : found.map((one) => one[1]).join(" ");
}
document.addEventListener("DOMContentLoaded", () => {
  const results = document.getElementById("search-results");
  const query = new URLSearchParams(location.search).get("q") || "";
  const words = query.toLowerCase().split(/\s+/).filter(Boolean);
  new MutationObserver(() => {
    for (const item of results.querySelectorAll("ul.search > li:not(.with-context)")) {
      item.classList.add("with-context");
      const text = textOf(item.querySelector("a"));
      if (!text) continue;
      const shown = item.appendChild(document.createElement("p"));
      shown.className = "context";
      shown.textContent = excerpt(text, words);
    }
  }).observe(results, { childList: true, subtree: true });
});
