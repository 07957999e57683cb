#!/usr/bin/env node
// Checks a fabric's card in headless Chromium at 1280, 800 and 390 px, light and dark: no error in the console, nothing
// reaches beyond the window, no table hides a part but that of several clips, no text of a drawing is cut off or covers
// another.
//
// usage: node tools/check_card.mjs CARD.html [--shots FOLDER]
//
// Needs Chromium (CHROMIUM=program, default /usr/bin/chromium). --shots also writes pictures of the whole page.
// Exit status 0: all passed.
import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { launch } from "./chromium.mjs";

const [card, ...options] = process.argv.slice(2);
const shots = options.includes("--shots") ? options[options.indexOf("--shots") + 1] : null;
if (shots) mkdirSync(shots, { recursive: true });

let failures = 0;
const check = (what, passed, detail = "") => {
  console.log(`${passed ? "ok  " : "FAIL"} ${what}${detail === "" ? "" : `  ${detail}`}`);
  if (!passed) failures++;
};

/** What reaches beyond the window, outside of boxes that scroll. */
const BEYOND = `(() => {
  const scrolls = e => e && (/auto|scroll/.test(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
  return [...document.querySelectorAll("body *")]
    .filter(e => e.getBoundingClientRect().right > innerWidth + 0.5 && !scrolls(e))
    .map(e => e.tagName + " " + e.textContent.trim().slice(0, 30)).slice(0, 5);
})()`;

/** How much of each table is out of sight. */
const HIDDEN = `[...document.querySelectorAll("table:not(.scrolls)")]
  .map(t => t.scrollWidth - t.clientWidth).filter(w => w > 1)`;

/** Texts of drawings that leave their drawing or cover each other. */
const TEXTS = `[...document.querySelectorAll("svg")].flatMap(svg => {
  const frame = svg.getBoundingClientRect(), texts = [...svg.querySelectorAll("text")];
  const boxes = texts.map(t => t.getBoundingClientRect());
  const inside = b => b.left > frame.left - 0.5 && b.right < frame.right + 0.5 && b.top > frame.top - 0.5
    && b.bottom < frame.bottom + 0.5;
  const out = (b, i) => inside(b) ? [] : [texts[i].textContent + " is cut off"];
  const touch = (a, b) => a.left < b.right && b.left < a.right && a.top + 2 < b.bottom && b.top + 2 < a.bottom;
  const over = (a, i) => boxes.slice(i + 1).flatMap((b, j) => touch(a, b)
    ? [texts[i].textContent + " covers " + texts[i + 1 + j].textContent] : []);
  return boxes.flatMap((b, i) => [...out(b, i), ...over(b, i)]);
})`;

const page = await launch();
await page.go(pathToFileURL(resolve(card)).href);
await page.waitFor("document.querySelector('main svg')", "the card");
for (const width of [1280, 800, 390]) {
  for (const scheme of ["light", "dark"]) {
    await page.look(width, scheme);
    const [beyond, hidden, texts] = await Promise.all([BEYOND, HIDDEN, TEXTS].map(page.evaluate));
    const place = `${width} px, ${scheme}`;
    check(`${place}: nothing reaches beyond the window`, beyond.length === 0, beyond.join("; "));
    check(`${place}: no table hides a part`, hidden.length === 0, hidden.map(w => `${w} px`).join(", "));
    check(`${place}: texts of the drawings are apart and whole`, texts.length === 0, texts.join("; "));
    if (shots) {
      const height = await page.evaluate("document.documentElement.scrollHeight");
      await page.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
      await page.shot(`${shots}/card_${width}_${scheme}.png`);
    }
  }
}
check("no complaint in the console", page.complaints.length === 0, page.complaints.join("; "));
await page.close();
process.exit(failures ? 1 : 0);
