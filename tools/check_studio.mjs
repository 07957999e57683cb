#!/usr/bin/env node
// Goes the way of a user through `tessuto studio` in headless Chromium, from a clip to an export by clicks and
// keys alone: no error in the console, few clicks, the server killed on the way loses nothing, nothing sticks
// out at 1280 and 800 px.
//
// usage: node tools/check_studio.mjs TESSUTO [--shots FOLDER] [--keep FOLDER] [--openings N] [--slow N]
//
// The clip is made here (`tessuto synth`, ffmpeg). Needs Node 18, Chromium (CHROMIUM=program, default
// /usr/bin/chromium) and ffmpeg (TESSUTO_FFMPEG). --shots writes a picture of every step at 1280 px in light;
// and, named after their looks, at 800 px and in dark. --keep uses that folder and leaves it. --slow 6 takes a
// processor that is six times slower for the page. Exit status 0: all passed.
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { launch, pause } from "./chromium.mjs";

const [program, ...options] = process.argv.slice(2);
const option = name => options.includes(name) ? options[options.indexOf(name) + 1] : null;
const tessuto = resolve(program), shots = option("--shots");
const folder = option("--keep") ?? mkdtempSync(join(tmpdir(), "studio-"));
const made = join(folder, "made"), project = join(folder, "project");
mkdirSync(project, { recursive: true });
if (shots) mkdirSync(shots, { recursive: true });

let failures = 0;
const check = (what, passed, detail = "") => {
  console.log(`${passed ? "ok  " : "FAIL"} ${what}${detail === "" ? "" : `  ${detail}`}`);
  if (!passed) failures++;
};

/** A clip of a moving sheet, made with `more` options. */
const makeClip = (name = "curtain", ...more) => {
  const scene = join(made, name === "curtain" ? "scene" : name), clip = join(made, `${name}.mp4`);
  execFileSync(tessuto, ["synth", scene, "--frames", "8", "--size", "224", "--grid", "13x13", "--seed", "3",
    "--wind", "4", ...more]);
  execFileSync(process.env.TESSUTO_FFMPEG ?? "ffmpeg", ["-v", "error", "-y", "-framerate", "25", "-i",
    join(scene, "rgbs/rgb_%03d.png"), "-pix_fmt", "yuv420p", "-crf", "14", clip]);
  return clip;
};

/** The server, and the address that it prints. */
const serve = async (...more) => {
  const child = spawn(tessuto, ["studio", "--no-browser", "--dir", project, ...more],
    { stdio: ["ignore", "pipe", "inherit"] });
  for await (const line of createInterface({ input: child.stdout })) {
    const address = /http:\S+/.exec(line)?.[0];
    if (address) return { child, address };
  }
  throw new Error("the studio has not started");
};

/** What a user would measure and click: size of the sheet [m] and its corners in the first frame [px]. */
const measure = (scene = join(made, "scene")) => {
  const camera = JSON.parse(readFileSync(join(scene, "scene.json"), "utf8"));
  const lines = readFileSync(join(scene, "template.obj"), "utf8").split("\n").filter(line => line.startsWith("v "));
  const points = lines.map(line => line.split(" ").slice(1).map(Number)), side = Math.sqrt(points.length);
  const along = step => Array.from({ length: side - 1 }, (_, k) => [points[k * step], points[(k + 1) * step]])
    .reduce((sum, [a, b]) => sum + Math.hypot(...a.map((v, i) => v - b[i])), 0);
  const pixel = ([x, y, z]) => [camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy];
  const corners = [0, side - 1, points.length - 1, points.length - side].map(k => pixel(points[k]));
  return { size: [along(1), along(side)], corners, width: camera.width, focal: camera.fx };
};

/**
 * Seconds of a person's attention, without waiting, by the keystroke-level model of Card, Moran and Newell
 * (1980): 0.28 s a key, 1.1 s to point, 0.2 s to press and let go, 0.4 s to bring a hand from the mouse to the
 * keys or back, 1.35 s to think before every click and entry. Beside it, a look at the masks of every frame,
 * half a second each, and a minute to measure the sheet and its camera's data.
 */
const attention = ({ clicks, keys, entries }, frames) =>
  clicks * (1.35 + 1.1 + 0.2) + entries * (1.35 + 2 * 0.4) + keys * 0.28 + frames * 0.5 + 60;
/** Frames of a clip of usual length, of which the one here is a fraction. */
const USUAL_FRAMES = 50;
/** How often a fresh clip is opened. */
const OPENINGS = Number(option("--openings") ?? 6);

/** Resident memory of a process [MB]. */
const memory = pid => Number(/VmHWM:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8"))?.[1] ?? NaN) / 1024;

const clip = makeClip(), sheet = measure();
let { child, address } = await serve();
const page = await launch();
if (option("--slow")) await page.send("Emulation.setCPUThrottlingRate", { rate: Number(option("--slow")) });
let step = 0;

/** A picture of the step as it is now, and whether it fits at both widths in both colours. */
const show = async name => {
  step++;
  for (const [width, scheme] of [[800, "dark"], [800, "light"], [1280, "dark"], [1280, "light"]]) {
    await page.look(width, scheme);
    await page.evaluate("scrollTo(0, 0)");
    const [inner, outer] =
      await page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]");
    if (inner > outer) check(`nothing sticks out: ${name} at ${width} px, ${scheme}`, false, `${inner} of ${outer} px`);
    if (shots) await page.shot(join(shots,
      `${step}-${name}${width === 1280 && scheme === "light" ? "" : `-${width}-${scheme}`}.png`));
  }
};
const at = name => page.waitFor(`!document.getElementById("${name}").hidden`, `step ${name}`, 60);
/** Whether something comes true: the page saves what was entered a little later. */
const soon = async what => {
  for (const until = Date.now() + 10000; Date.now() < until; await pause(50)) if (await what()) return true;
  return false;
};
const calm = async () => {
  const text = await page.evaluate(`(e => e.hidden ? "" : e.innerText)(document.getElementById("alarm"))`);
  if (text) throw new Error(`the page says: ${text}`);
};

try {
  await page.look(1280, "light");
  const started = performance.now();
  await page.go(address);
  await page.waitFor("document.body?.dataset.ready", "the page");
  await page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))");
  const first = (performance.now() - started) / 1000;
  console.log(`first page drawn after ${first.toFixed(2)} s (at most 1 s on a quiet machine)`);
  check("the token has left the address", !(await page.evaluate("location.href")).includes("token"));
  await show("clip");

  await page.chooseFile(clip, () => page.click("#drop"));
  await at("trim");
  await page.waitFor(`document.getElementById("trim-wait").hidden`, "the frames of the clip");
  await page.evaluate(`document.getElementById("trim-end").focus()`);
  for (let k = 0; k < 4; k++) await page.press("ArrowLeft");
  check("the end of the part follows the keys",
    (await page.evaluate(`document.getElementById("trim-text").textContent`)).startsWith("frames 0 to 3 of 8"));
  await page.evaluate(`document.getElementById("trim-start").focus()`);
  await page.press("ArrowRight");
  check("… and so does the start",
    (await page.evaluate(`document.getElementById("trim-text").textContent`)).startsWith("frames 1 to 3 of 8"));
  // Back to the frame whose corners are known.
  await page.press("ArrowLeft");
  await pause(300);
  await show("part");
  Object.assign(page, { clicks: 0, keys: 0, entries: 0 });
  const person = performance.now();

  await page.click("#trim-next");
  await at("fabric");
  await page.waitFor(`document.getElementById("outline-wait").hidden`, "the first frame");
  const canvas = await page.box("#outline");
  const inWindow = ([x, y]) =>
    [canvas.x + (x + 0.5) * canvas.width / sheet.width, canvas.y + (y + 0.5) * canvas.width / sheet.width];
  for (const k of [2, 0, 1, 3]) await page.clickAt(...inWindow(sheet.corners[k]));
  const form = () => page.evaluate(
    `fetch("/api/state?work=scenes/curtain").then(a => a.json()).then(s => s.work.form)`);
  const outline = async () => (await form()).outline;
  await page.waitFor(`document.activeElement.id === "width"`, "the width to be asked for after the fourth corner");
  await page.type((sheet.size[0] * 100).toFixed(2));
  await page.press("Tab");
  await page.type((sheet.size[1] * 100).toFixed(2));
  // Past the unit to the camera, whose entries are found by their first letters.
  for (const key of ["Tab", "Tab", ..."foc", "Tab"]) await page.press(key);
  await page.type(String(sheet.focal));
  check("the camera is chosen by keys", await soon(async () => (await form()).camera?.fx === sheet.focal));
  const kept = await outline(), scale = sheet.width / canvas.width;
  const off = Math.max(...kept.map((p, k) => Math.hypot(p.x - sheet.corners[k][0], p.y - sheet.corners[k][1])));
  check("four corners, in their order, where they were clicked", kept.length === 4 && off <= scale,
    `off by ${off.toFixed(2)} px of the clip`);
  const { clicks, keys, entries } = page;

  const place = await page.evaluate(
    `(r => [r.x, r.y, r.width])(document.querySelector("#outline").getBoundingClientRect())`);
  check("the picture has stayed where it was", place.every((v, k) => v === [canvas.x, canvas.y, canvas.width][k]),
    `${place}`);

  // Beside the way: a wrong point, dragged, nudged and undone.
  const [x, y] = inWindow(kept.map(p => [p.x, p.y])[2]);
  await page.drag([x, y], [x - 40, y - 30]);
  await page.press("ArrowRight");
  const nudged = ({ x, y }) => Math.abs(x - kept[2].x + 40 * scale - 1) < 1.5 * scale
    && Math.abs(y - kept[2].y + 30 * scale) < 1.5 * scale;
  check("a point is dragged and nudged", await soon(async () => nudged((await outline())[2])));
  await page.press("z", 2);
  await page.press("z", 2);
  check("… and undone", await soon(async () => JSON.stringify(await outline()) === JSON.stringify(kept)));
  await page.send("Input.dispatchMouseEvent", { type: "mouseMoved", x: x - 6, y: y - 5 });
  await show("fabric");
  Object.assign(page, { clicks, keys, entries });

  // The server is killed: nothing is lost, and the page goes on where it was.
  const gone = new URL(address).host;
  child.kill("SIGKILL");
  ({ child, address } = await serve());
  await page.go(`${address}#scenes/curtain`);
  await at("fabric");
  await page.waitFor(`document.getElementById("outline-wait").hidden`, "the first frame");
  check("a killed server loses nothing", JSON.stringify(await outline()) === JSON.stringify(kept));

  // Another window changes what was entered: this one shows it, and what is entered into the old state is
  // refused, not mixed with it.
  const elsewhere = (change, base = "") => page.evaluate(`(async () => {
    const state = await (await fetch("/api/state?work=scenes/curtain")).json();
    const form = { ...state.work.form, ...${JSON.stringify(change)} };
    const headers = { "Content-Type": "application/json" };
    return (await fetch("/api/save?work=scenes/curtain${base}",
      { method: "POST", headers, body: JSON.stringify(form) })).status;
  })()`);
  const entered = () => page.evaluate(`["width", "height"].map(id => Number(document.getElementById(id).value))`);
  const measured = (await form()).size;
  check("another window's entry is kept", await elsewhere({ size: [0.4, 0.3] }) === 200);
  check("… and is shown here", await soon(async () => (await entered()).join() === "40,30"), (await entered()).join());
  check("… an entry into an older state is refused",
    await elsewhere({ size: [0.1, 0.1] }, "&base=0000000000000000") === 409);
  await elsewhere({ size: [0.2, 0.25] });
  await page.evaluate(`(input => {
    input.value = "77";
    input.dispatchEvent(new Event("input", { bubbles: true }));
  })(document.getElementById("width"))`);
  await page.waitFor(`!document.getElementById("alarm").hidden || document.getElementById("width").value === "20"`,
    "the other window's entry");
  const both = await page.evaluate(`document.getElementById("alarm").innerText`);
  check("two entries at once: the other's is shown, and it is said",
    (await entered()).join() === "20,25" && both.includes("another window"), both);
  check("… and none is mixed", ((await form()).size).join() === "0.2,0.25", ((await form()).size).join());
  await page.press("Escape");
  await elsewhere({ size: measured });
  await soon(async () => Math.abs((await entered())[0] - 100 * measured[0]) < 1e-3);
  Object.assign(page, { clicks, keys, entries });

  await page.click("#fabric-next");
  await page.waitFor(`!document.getElementById("check").hidden || !document.getElementById("alarm").hidden`,
    "masks", 60);
  await calm();
  await page.waitFor(`document.getElementById("overlay").width > 300`, "the overlay");
  await pause(300);
  await show("check");

  // Beside the way: two places are said to be fabric and none, one more is taken back, and the masks are made anew.
  const way = { clicks: page.clicks, keys: page.keys, entries: page.entries }, overlay = await page.box("#overlay");
  const onOverlay = (u, v) => page.clickAt(overlay.x + u * overlay.width, overlay.y + v * overlay.height);
  const state = () => page.evaluate(`fetch("/api/state?work=scenes/curtain").then(a => a.json())`);
  const before = (await state()).work.masks_version;
  await page.press("o");
  await onOverlay(0.03, 0.03);
  await page.press("i");
  await onOverlay(0.5, 0.5);
  await onOverlay(0.9, 0.9);
  await page.click("#masks-undo");
  await page.click("#masks-next");
  let mended = before;
  for (const until = Date.now() + 60000;
    Date.now() < until && (mended.job?.running || mended === before || mended.masks_version === before);) {
    await pause(100);
    mended = (await state()).work;
  }
  const said = mended.masks?.clicks ?? [];
  const percent = v => Math.round(100 * v / sheet.width);
  const placed = said.map(c => `${c.inside ? "fabric" : "none"} ${percent(c.x)} ${percent(c.y)}`).sort();
  check("clicks inside and outside reach the masks, one taken back does not",
    placed.join(", ") === "fabric 50 50, none 3 3", placed.join(", "));
  await page.waitFor(`!document.getElementById("check-next").disabled`, "the masks", 60);
  await calm();
  Object.assign(page, way);

  // Motion alone, which takes seconds.
  await page.click("#appearance");
  await page.click("#check-next");
  await at("run");
  const seconds = (performance.now() - person) / 1000;
  check("from an opened clip to a running reconstruction in 8 clicks", page.clicks <= 8,
    `${page.clicks} clicks; this script, with waiting: ${seconds.toFixed(0)} s`);
  const attended = attention(page, USUAL_FRAMES);
  const acts = `${page.clicks} clicks, ${page.keys} keys, ${page.entries} entries, every frame looked at`;
  check("a person's part takes at most 3 minutes by the keystroke-level model", attended <= 180,
    `${attended.toFixed(0)} s: ${acts}`);
  // Stopped at once, before it can end; it goes on to the same end.
  await page.waitFor(`!document.getElementById("stop").hidden`, "the button to stop", 60);
  await page.click("#stop");
  await page.waitFor(`!document.getElementById("run-again").hidden`, "the stop", 60);
  check("a reconstruction is stopped",
    (await page.evaluate(`document.getElementById("run-title").textContent`)) === "Not finished"
    && !existsSync(join(project, "results/curtain")));
  await calm();
  await page.click("#run-next");
  await page.waitFor(`!document.getElementById("stop").hidden`, "the reconstruction to go on", 60);
  check("… and goes on", true);
  await page.waitFor(`!document.getElementById("live").hidden || !document.getElementById("result").hidden`,
    "the live view", 60);
  await pause(1500);
  await show("reconstruct");
  await page.waitFor(`!document.getElementById("result").hidden || !document.getElementById("alarm").hidden`,
    "the result", 400);
  await calm();
  await page.waitFor(`document.getElementById("report").src.includes("report.html")`, "the report");
  await page.click("[data-format=pc2]");
  await page.waitFor(`document.getElementById("files").textContent.includes(".pc2")`, "the export", 60);
  await pause(1500);
  await show("result");
  await calm();
  const exported = readdirSync(join(project, "results/curtain/export"));
  check("the export is there", [".glb", ".pc2"].every(ending => exported.some(name => name.endsWith(ending))),
    exported.join(" "));
  const length = await page.evaluate(
    `fetch(document.querySelector("#files a").href).then(a => a.arrayBuffer()).then(b => b.byteLength)`);
  check("… and can be downloaded", length > 1000, `${length} bytes`);
  // What starts by itself when a clip is opened never alarms.
  let alarms = 0;
  for (let k = 0; k < OPENINGS; k++) {
    copyFileSync(clip, join(project, `again${k}.mp4`));
    await page.go(`${address}#again${k}.mp4`);
    await page.waitFor(`document.getElementById("work-name").textContent === "again${k}"`, "the clip", 60);
    await page.waitFor(`document.getElementById("trim-wait").hidden`, "the frames of the clip", 60);
    alarms += await page.evaluate(`Number(!document.getElementById("alarm").hidden)`);
  }
  check(`${OPENINGS} openings without an alarm`, alarms === 0, `${alarms} with one`);
  // A camera that moved: the masks are refused, and the page offers commands that work.
  const held = makeClip("held", "--orbit", "20", "--surroundings"), about = measure(join(made, "held"));
  copyFileSync(held, join(project, "held.mp4"));
  await page.go(`${address}#held.mp4`);
  await page.waitFor(`document.getElementById("work-name").textContent === "held"`, "the clip", 60);
  await page.waitFor(`document.getElementById("trim-wait").hidden`, "the frames of the clip", 60);
  await page.evaluate(`(async () => {
    const { work } = await (await fetch("/api/state?work=scenes/held")).json();
    const form = { ...work.form, size: ${JSON.stringify(about.size)},
      camera: { kind: "focal", fx: ${about.focal}, fy: null, centre: null },
      outline: ${JSON.stringify(about.corners.map(([x, y]) => ({ x, y, corner: true })))} };
    const headers = { "Content-Type": "application/json" };
    await fetch("/api/save?work=scenes/held", { method: "POST", headers, body: JSON.stringify(form) });
  })()`);
  await pause(1500);
  await page.click("#steps [data-step=fabric]");
  await at("fabric");
  await page.waitFor(`document.getElementById("outline-wait").hidden`, "the first frame", 60);
  await page.click("#fabric-next");
  await page.waitFor(`!document.getElementById("alarm").hidden`, "the refusal", 60);
  const offered = await page.evaluate(
    `[...document.querySelectorAll("#motion-offer:not([hidden]) pre")].map(pre => pre.textContent)`);
  const refusal = await page.evaluate(`document.getElementById("alarm").innerText`);
  check("a camera that moved is named, and three commands are offered",
    refusal.includes("did not stand still") && offered.length === 3, refusal.split("\n")[0]);
  await show("moved");
  await page.press("Escape");
  const typed = (offered[0] ?? "").replace("CAPTURE", join(made, "held/poses.json")).replace(/^tessuto /, "");
  execFileSync("sh", ["-c", `"$0" ${typed}`, tessuto], { cwd: project, stdio: "ignore" });
  check("… the first of them makes the scene", existsSync(join(project, "scenes/held/masks/mask_007.png")));
  // Fabric of another shape on a table: its border is clicked, changed, kept over a reload, and becomes the first mask.
  copyFileSync(clip, join(project, "vest.mp4"));
  await page.look(1280, "light");
  await page.go(`${address}#vest.mp4`);
  await page.waitFor(`document.getElementById("work-name").textContent === "vest"`, "the clip", 60);
  await page.waitFor(`document.getElementById("trim-wait").hidden`, "the frames of the clip", 60);
  await page.click("#steps [data-step=fabric]");
  await at("fabric");
  await page.waitFor(`document.getElementById("outline-wait").hidden`, "the first frame", 60);
  await page.click("[name=shape][value=other]");
  const vest = async () => (await page.evaluate(
    `fetch("/api/state?work=scenes/vest").then(a => a.json()).then(s => s.work.form)`));
  const button = () => page.evaluate(`document.getElementById("fabric-next").textContent`);
  const drawn = await page.box("#outline"), [c0, c1, c2, c3] = sheet.corners;
  const inDrawn = ([x, y]) =>
    [drawn.x + (x + 0.5) * drawn.width / sheet.width, drawn.y + (y + 0.5) * drawn.width / sheet.width];
  const between = (a, b) => a.map((v, k) => (v + b[k]) / 2);
  for (const p of [c0, between(c0, c1), c1, c2, c3]) await page.clickAt(...inDrawn(p));
  check("an outline has to be closed", (await button()) === "Close the outline", await button());
  // A click that trembles.
  const [firstX, firstY] = inDrawn(c0);
  await page.drag([firstX + 4, firstY], [firstX + 6, firstY + 1]);
  await page.waitFor(`document.activeElement.id === "distance"`, "the distance to be asked for", 10);
  check("the first point again closes it", await soon(async () => (await vest()).closed)
    && (await vest()).outline.length === 5 && Math.abs((await vest()).outline[0].x - c0[0]) < 1);
  await page.clickAt(...inDrawn(between(c1, c2)));
  check("a click on a side adds a point", await soon(async () => (await vest()).outline.length === 6));
  await page.press("Delete");
  check("… and Delete removes it", await soon(async () => (await vest()).outline.length === 5));
  // From the upper left corner, number 1, to the lower right one, number 4: chosen by keys.
  await page.evaluate(`document.getElementById("from-point").focus()`);
  for (const key of ["Home", "1", "Tab", "Home", "4", "Tab"]) await page.press(key);
  const ends = async () => (await vest()).outline.flatMap((p, k) => p.measured ? [k + 1] : []).join();
  check("two of its points are chosen by keys", await soon(async () => (await ends()) === "1,4"), await ends());
  const across = Math.hypot(...sheet.size) * 100;
  await page.type("far");
  check("a length that is none is named",
    await page.evaluate(`document.getElementById("distance-note").innerText.includes("no length")`));
  for (const _ of "far") await page.press("Backspace");
  await page.type(across.toFixed(2));
  check("a lens that is not known is asked for", await soon(async () => (await button()) === "Enter the camera")
    && await page.evaluate(`!document.getElementById("camera-guess").hidden`), await button());
  await page.evaluate(`document.getElementById("camera").focus()`);
  for (const key of [..."foc", "Tab"]) await page.press(key);
  await page.type(String(sheet.focal));
  check("… and then masks can be made", await soon(async () => (await button()) === "Make the masks"), await button());
  await soon(async () => (await vest()).camera?.fx === sheet.focal);
  await show("outline");
  await page.look(390, "light");
  await page.evaluate("scrollTo(0, 0)");
  const [wide, narrow] =
    await page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]");
  check("nothing sticks out: outline at 390 px", wide <= narrow, `${wide} of ${narrow} px`);
  if (shots) await page.shot(join(shots, `${step}-outline-390-light.png`));
  const small = await page.box("#outline"), [px, py] = c2.map(v => (v + 0.5) * small.width / sheet.width);
  await page.drag([small.x + px, small.y + py], [small.x + px - 20, small.y + py - 20]);
  const moved = async () => (await vest()).outline[3].x < c2[0] - 10;
  check("… a point is dragged there", await soon(moved));
  await page.press("z", 2);
  check("… and put back", await soon(async () => !(await moved())));
  await page.look(1280, "light");
  const entered0 = JSON.stringify(await vest());
  await page.go(`${address}#scenes/vest`);
  await at("fabric");
  await page.waitFor(`document.getElementById("outline-wait").hidden`, "the first frame", 60);
  check("a reload keeps outline, distance and points", JSON.stringify(await vest()) === entered0
    && (await button()) === "Make the masks"
    && await page.evaluate(`document.getElementById("to-point").value`) === "3", await button());
  await page.click("#fabric-next");
  await page.waitFor(`!document.getElementById("check").hidden || !document.getElementById("alarm").hidden`,
    "masks and template", 60);
  await calm();
  const record = name => JSON.parse(readFileSync(join(project, "scenes/vest", name), "utf8"));
  const { border, frames: [{ confidence }] } = record("masks.json"), { kind, size, overlap } = record("template.json");
  check("the outline is the first mask and the template's", border === "drawn" && confidence === 1
    && kind === "outline" && overlap > 0.95, `${border} ${confidence} ${kind} ${overlap}`);
  check("… which has the measured size", size.every((v, k) => Math.abs(v / sheet.size[k] - 1) < 0.08),
    `${size} m of ${sheet.size} m`);
  await pause(300);
  await show("outline-check");
  const peak = memory(child.pid);
  check("the server takes at most 150 MB", peak <= 150, `${peak.toFixed(1)} MB at most`);
  // What the page asks of the killed server before it is left is refused.
  // Two entries were refused on purpose.
  const meant = text => text.includes("ERR_CONNECTION_REFUSED") && text.includes(gone)
    || text.includes("409") && text.includes("/api/save");
  const complaints = page.complaints.filter(text => !meant(text));
  check("no complaint in the console", complaints.length === 0, complaints.join(" | "));
} catch (error) {
  check(error.message, false);
  if (shots) await page.shot(join(shots, "failed.png")).catch(() => {});
  console.log(await page.evaluate("document.body.innerText").catch(() => ""));
} finally {
  // What still runs would go on without the server.
  await page.evaluate(`fetch("/api/stop", { method: "POST" })`).catch(() => {});
  await pause(200);
  await page.close();
  child.kill();
  if (!option("--keep")) rmSync(folder, { recursive: true, force: true });
}
process.exit(failures > 0 ? 1 : 0);
