#!/usr/bin/env node
// Checks a report page in headless Chromium, as a user would: no error in the console, nothing asked of the network,
// the 3D view and the video are not blank, playing advances the frame, slider, keys and wipe move, every look draws.
//
// usage: node tools/check_report.mjs REPORT.html [--shots FOLDER] [--no-truth]
//
// Needs `npm install puppeteer-core` where it is run, and Chromium (CHROMIUM=program, default /usr/bin/chromium).
// --shots also writes pictures of the page at 1280, 800 and 390 px, light and dark. Exit status 0: all passed.
import { createRequire } from "node:module";
import { mkdirSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const puppeteer = createRequire(pathToFileURL(resolve("package.json")))("puppeteer-core");
const [report, ...options] = process.argv.slice(2);
const shots = options.includes("--shots") ? options[options.indexOf("--shots") + 1] : null;
const address = /^https?:/.test(report) ? report : pathToFileURL(resolve(report)).href;
if (shots) mkdirSync(shots, { recursive: true });

let failures = 0;
const check = (what, passed, detail = "") => {
  console.log(`${passed ? "ok  " : "FAIL"} ${what}${detail === "" ? "" : `  ${detail}`}`);
  if (!passed) failures++;
};
const pause = ms => new Promise(done => setTimeout(done, ms));
/** Waits until something is so, for ten seconds at most: a busy machine draws late. Whether it is. */
const until = async holds => {
  for (const end = performance.now() + 10000; performance.now() < end; await pause(50)) if (await holds()) return true;
  return holds();
};

const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage();
const complaints = [], requests = [];
// The driver's own remarks on reading pixels back are none of the page's.
const ofDriver = text => /GPU stall due to ReadPixels|GL Driver Message/.test(text);
page.on("console", m => {
  if (["error", "warn"].includes(m.type()) && !ofDriver(m.text())) complaints.push(m.text());
});
page.on("pageerror", e => complaints.push(String(e)));
page.on("request", r => { if (/^(https?|wss?|ftp):/.test(r.url())) requests.push(r.url()); });
await page.setViewport({ width: 1280, height: 900 });

/** Opens the page; seconds to its first frame. */
const open = async () => {
  const started = performance.now();
  await page.goto(address, { waitUntil: "domcontentloaded" });
  await page.waitForFunction(() => tessuto.page?.view?.drawn > 0 && tessuto.page.wipe.drawn > 0, { polling: 20 });
  return (performance.now() - started) / 1000;
};
// The quickest opening counts: others than the page keep a machine busy.
const openings = [await open()];
while (Math.min(...openings) > 2 && openings.length < 5) openings.push(await open());
check("first frame within 2 s", Math.min(...openings) <= 2, `${openings.map(s => s.toFixed(2)).join(", ")} s`);
await page.waitForFunction(() => tessuto.page.charts.plots.length > 0);
await pause(300);

/** Number of different colours that a part of the page shows. */
const colours = async selector => {
  const shot = await (await page.$(selector)).screenshot({ encoding: "base64" });
  return page.evaluate(async text => {
    const image = new Image();
    image.src = `data:image/png;base64,${text}`;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height), pen = canvas.getContext("2d");
    pen.drawImage(image, 0, 0);
    const { data } = pen.getImageData(0, 0, image.width, image.height);
    const seen = new Set();
    for (let i = 0; i < data.length; i += 4) seen.add(data[i] >> 3 << 10 | data[i + 1] >> 3 << 5 | data[i + 2] >> 3);
    return seen.size;
  }, shot);
};
const frame = () => page.evaluate(() => tessuto.page.player.frame);
const value = id => page.$eval(`#${id}`, e => Number(e.value));

check("the 3D view is not blank", await colours("#cloth") > 60, `${await colours("#cloth")} colours`);
check("the video is not blank", await colours("#film") > 60, `${await colours("#film")} colours`);
const count = await page.evaluate(() => tessuto.page.player.frameCount);

await page.click("#play");
const advances = await until(async () => await frame() > 0);
await page.click("#play");
const played = await frame();
check("playing advances the frame", advances, `frame ${played} of ${count}`);
await pause(200);
check("… and stops", await frame() === played);
await page.$eval("#scrub", (e, v) => { e.value = v; e.dispatchEvent(new Event("input")); }, count - 1);
check("the slider moves the frame",
  await frame() === count - 1 && (await page.$eval("#frame", e => e.textContent)).includes(String(count - 1)));
await page.evaluate(() => document.activeElement.blur());
await page.keyboard.press("Home");
await page.keyboard.press("ArrowRight");
check("keys move the frame and the slider", await frame() === 1 && await value("scrub") === 1);
await page.keyboard.press("Space");
check("space plays", await until(async () => await frame() > 1));
await page.keyboard.press("Space");
const states = await page.evaluate(() => tessuto.page.data.verdicts.map(v => v.state));
check("every frame has a verdict", states.length === count, `${states.length} of ${count}`);
if (states.some(state => state !== "found")) {
  await page.keyboard.press("n");
  const told = await page.$eval("#state-text", e => e.textContent);
  check("N goes to a doubtful or lost frame, and its reason is shown",
    states[await frame()] !== "found" && told.startsWith(states[await frame()]), told);
  await page.click("#next-doubt");
  check("… and so does the button", states[await frame()] !== "found");
}

const box = await (await page.$("#film-box")).boundingBox();
await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
await page.mouse.down();
await page.mouse.move(box.x + box.width * 0.4, box.y + box.height / 2, { steps: 4 });
await page.mouse.up();
check("the wipe follows the pointer", await value("wipe") < 480, `${await value("wipe")} of 1000`);

const canvas = await (await page.$("#cloth")).boundingBox();
const place = () => page.evaluate(() => tessuto.page.view.camera.position.toArray());
const before = await place();
await page.mouse.move(canvas.x + canvas.width / 2, canvas.y + canvas.height / 2);
await page.mouse.down();
await page.mouse.move(canvas.x + canvas.width * 0.7, canvas.y + canvas.height * 0.6, { steps: 4 });
await page.mouse.up();
await pause(300);
const after = await place();
check("dragging turns the view", Math.hypot(...before.map((v, i) => v - after[i])) > 0.05);
const middle = await page.evaluate(() => tessuto.page.view.centre.clone().project(tessuto.page.view.camera).toArray());
await page.mouse.move(canvas.x + canvas.width * (1 + middle[0]) / 2, canvas.y + canvas.height * (1 - middle[1]) / 2,
  { steps: 3 });
const probe = () => page.$eval("#probe", e => e.textContent);
check("the pointer shows a value", await until(async () => (await probe()).includes("vertex")), await probe());

const looks = await page.$$eval("#look option", all => all.map(o => o.value));
for (const look of looks) {
  await page.select("#look", look);
  await pause(150);
  const seen = await colours("#cloth");
  check(`look: ${look}`, seen > 40, `${seen} colours`);
}
if (looks.includes("lit")) {
  await page.select("#look", "lit");
  const shown = async () => (await page.$("#cloth")).screenshot({ encoding: "base64" });
  await pause(300);
  let last = await shown();
  const changed = async what => {
    check(what, await until(async () => await shown() !== last) && await colours("#cloth") > 40);
    last = await shown();
  };
  for (const light of (await page.$$eval("#light option", all => all.map(o => o.value))).slice(1)) {
    await page.select("#light", light);
    await changed(`light: ${light}`);
  }
  await page.$eval("#turn", e => { e.value = 120; e.dispatchEvent(new Event("input")); });
  await changed("the light turns");
}
for (const name of ["strain", "force"].concat(options.includes("--no-truth") ? [] : ["depth_error"])) {
  check(`there is a look for ${name}`, looks.includes(name));
}
for (const layer of await page.$$eval("#layer option", all => all.map(o => o.value))) {
  const drawn = await page.evaluate(() => tessuto.page.wipe.drawn);
  await page.select("#layer", layer);
  await page.waitForFunction(n => tessuto.page.wipe.drawn > n, {}, drawn);
  check(`video against ${layer}`, await colours("#film") > 60);
}
await page.select("#look", looks[0]);
await page.evaluate(() => document.activeElement.blur());
const plain = await page.evaluate(() => tessuto.page.view.drawn);
await page.keyboard.press("w");
await page.waitForFunction(n => tessuto.page.view.drawn > n, {}, plain).catch(() => {});
check("W shows the threads",
  await page.evaluate(() => tessuto.page.view.lines.visible && tessuto.page.view.drawn) > plain);
await page.keyboard.press("w");
await page.evaluate(() => document.activeElement.blur());

// A click into the middle of a curve over the frames goes there.
const plot = await page.$("#frame-charts .u-over");
if (plot) {
  await page.keyboard.press("Home");
  await plot.click();
  check("a click on a curve goes to its frame", await frame() > 0, `frame ${await frame()}`);
  const legend = await page.$eval("#frame-charts .key", e => e.textContent);
  check("curves show the values of a frame", /\d/.test(legend.replace(/[^\d]/g, "")),
    legend.replace(/\s+/g, " ").trim());
}

// What moved it: arrows and changed replays, where causes were searched.
const causes = await page.evaluate(() => {
  const { causes } = tessuto.page.data;
  return causes && {
    forces: causes.forces.map(f => f.key), replays: causes.replays.map(r => [r.key, r.motion.frames]),
  };
});
if (causes) {
  const shown = async () => (await page.$("#cloth")).screenshot({ encoding: "base64" });
  for (const key of causes.forces) {
    await pause(300);
    const before = await shown();
    await page.click(`[data-force=${key}]`);
    const drawn = await until(async () => await shown() !== before);
    const bars = await page.$$eval("#arrow-scale div", all => all.map(row => row.textContent));
    check(`arrows: ${key}`, drawn && bars.length > 0, bars.join(", "));
    if (shots) await (await page.$("#cloth-panel")).screenshot({ path: `${shots}/arrows-${key}.png` });
    await page.click(`[data-force=${key}]`);
  }
  for (const [key, frames] of causes.replays) {
    await page.click(`[data-replay=${key}]`);
    await pause(300);
    await page.evaluate(n => { tessuto.page.player.toggle(false); tessuto.page.player.seek(n - 1); }, frames);
    await pause(300);
    // Where the fabric is, and where it was found to be, in the last frame of both.
    const moved = await page.evaluate(() => {
      const { view } = tessuto.page, place = motion => Float32Array.from(motion.at(motion.frames - 1));
      const [now, found] = [view.replay, view.motion].map(place);
      return Math.max(...now.map((v, i) => Math.abs(v - found[i])));
    });
    check(`replay: ${key}`, await frame() === frames - 1 && moved > 1e-3,
      `${frames} frames, ${(1000 * moved).toFixed(0)} mm from the last one found`);
    if (shots) await (await page.$("#cloth-panel")).screenshot({ path: `${shots}/replay-${key}.png` });
  }
  if (causes.replays.length) await page.click("[data-replay=found]");
  check("what was found plays again",
    await page.evaluate(() => tessuto.page.view.replay === null && tessuto.page.player.frameCount) === count);
  const words = await page.$$eval("#causes td", all => all.map(cell => cell.textContent));
  check("the table says which causes are informed", words.includes("informed") || words.includes("not informed"));
}

// Where the cameras stood: pages of several cameras, or of one that moves.
const cameras = await page.evaluate(() => tessuto.page.cameras?.all.map(({ name, poses }) => [name, poses.length]));
if (cameras) {
  /** Largest distance, in parts of the image, between a vertex as the 3D view shows it and as the lens sees it. */
  const apart = () => page.evaluate(() => {
    const { view, wipe, player } = tessuto.page;
    view.drawNow();
    const { film } = wipe, { width, height } = view.size, scale = Math.min(width / film.width, height / film.height);
    const pose = view.poseAt(player.frame), p = tessuto.seenFrom(pose, view.motion.at(player.frame)).slice();
    const shown = view.linePositions.array;
    let worst = 0;
    for (let i = 0; i < p.length; i += 3) {
      const at = new THREE.Vector3(...shown.subarray(i, i + 3));
      at.applyMatrix4(view.world.matrixWorld).project(view.camera);
      const { fx, fy, cx, cy } = film.camera;
      const x = (fx * p[i] / p[i + 2] + cx + 0.5 - film.width / 2) * scale;
      const y = (fy * p[i + 1] / p[i + 2] + cy + 0.5 - film.height / 2) * scale;
      worst = Math.max(worst, Math.hypot(at.x * width / 2 - x, -at.y * height / 2 - y) / (film.width * scale));
    }
    return worst;
  });
  /** Fraction of the threads' corners that lie on something in the video, and whether they lie on the image. */
  const onFabric = () => page.evaluate(async () => {
    const { wipe, player } = tessuto.page, { film } = wipe;
    const image = new Image();
    image.src = `data:image/jpeg;base64,${film.layers[0].frames[player.frame]}`;
    await image.decode();
    const canvas = new OffscreenCanvas(film.width, film.height), pen = canvas.getContext("2d");
    pen.drawImage(image, 0, 0);
    const { data } = pen.getImageData(0, 0, film.width, film.height);
    const { positions: p } = wipe.mesh(player.frame), { fx, fy, cx, cy } = film.camera;
    let on = 0;
    for (let i = 0; i < p.length; i += 3) {
      const x = Math.round(fx * p[i] / p[i + 2] + cx), y = Math.round(fy * p[i + 1] / p[i + 2] + cy);
      const k = 4 * (y * film.width + x);
      on += x >= 0 && x < film.width && y >= 0 && y < film.height && Math.max(data[k], data[k + 1], data[k + 2]) > 12;
    }
    return on / (p.length / 3);
  });
  const shown = async id => (await page.$(id)).screenshot({ encoding: "base64" });
  const settle = () => pause(250);
  await page.evaluate(() => {
    tessuto.page.player.toggle(false);
    tessuto.page.player.seek(0);
    scrollTo(0, 0);
  });
  await page.$eval("#show-cameras", e => e.checked || e.click());
  if (await page.$eval("#through-camera", e => e.checked)) await page.click("#through-camera");
  await page.evaluate(() => tessuto.page.view.orbitView());
  await settle();
  const places = () => page.evaluate(() => tessuto.page.cameras.all.map(({ corners, body }) => {
    const { view } = tessuto.page, at = new THREE.Vector3();
    // The middle of the image's plane, nearer to the eye.
    for (let k = 1; k < 5; k++) at.add(new THREE.Vector3(...corners.array.subarray(3 * k, 3 * k + 3)));
    at.multiplyScalar(0.15).add(new THREE.Vector3(...corners.array.subarray(0, 3)).multiplyScalar(0.4));
    const { x, y } = at.clone().project(view.camera), box = view.elements.canvas.getBoundingClientRect();
    return { at: at.toArray(), visible: body.visible,
      x: box.left + (x + 1) / 2 * box.width, y: box.top + (1 - y) / 2 * box.height,
      inside: Math.abs(x) < 1 && Math.abs(y) < 1 };
  }));
  check("every camera is in sight", (await places()).every(p => p.visible && p.inside), cameras.join("; "));
  const withCameras = await shown("#cloth");
  await page.click("#show-cameras");
  await settle();
  check("… and goes if it is not wanted",
    await shown("#cloth") !== withCameras && (await places()).every(p => !p.visible));
  await page.click("#show-cameras");
  await settle();
  const moving = await page.evaluate(() => tessuto.page.cameras.all.map(({ way }) => Boolean(way?.visible)));
  check("the way of each that moves is a line", moving.every((seen, k) => seen === cameras[k][1] > 1));
  const start = await places();
  await page.evaluate(n => tessuto.page.player.seek(n), count - 1);
  await settle();
  const end = await places();
  check("those that move, and no others, are elsewhere in the last frame",
    end.every((p, k) => p.at.some((v, a) => Math.abs(v - start[k].at[a]) > 1e-4) === moving[k]));
  for (const [k, [name]] of cameras.entries()) {
    await page.evaluate(() => tessuto.page.view.orbitView());
    await settle();
    const { x, y } = (await places())[k], film = await shown("#film");
    await page.mouse.move(x, y);
    const said = await until(async () => (await probe()).includes(name));
    await page.mouse.click(x, y);
    await settle();
    const through = await page.$eval("#through-camera", e => e.checked);
    check(`a click on camera ${name} looks through it`,
      said && through && await page.evaluate(() => tessuto.page.cameras.chosen) === k);
    if (cameras.length > 1) {
      const tag = await page.$eval("#film-tag", e => e.textContent);
      check("… and shows its video", tag.includes(name) && (k === 0 || await shown("#film") !== film), tag);
    }
    check("… which the view through it and the threads lie on", await apart() < 5e-3 && await onFabric() > 0.97,
      `${(100 * await apart()).toFixed(2)} % apart, ${(100 * await onFabric()).toFixed(1)} % on the fabric`);
    if (shots) {
      await page.select("#layer", "mesh");
      await settle();
      await page.screenshot({ path: `${shots}/through-${k}.png` });
    }
    await page.click("#through-camera");
  }
  if (cameras.length > 1) {
    await page.click("#cameras [data-camera='1']");
    const pressed = await page.$$eval("#cameras button", all => all.map(b => b.getAttribute("aria-pressed")));
    check("a button chooses the camera", pressed.every((p, k) => p === String(k === 1)), pressed.join(", "));
    await page.evaluate(() => document.activeElement.blur());
    for (let k = 1; k < cameras.length; k++) await page.keyboard.press("v");
    check("V goes around to the first", await page.evaluate(() => tessuto.page.cameras.chosen) === 0);
  }
  await page.evaluate(() => tessuto.page.player.seek(0));
}

for (const width of [1280, 800, 390]) {
  for (const scheme of ["light", "dark"]) {
    await page.setViewport({ width, height: 900 });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
    await pause(500);
    const [inner, outer] = await page.evaluate(() =>
      [document.documentElement.scrollWidth, document.documentElement.clientWidth]);
    check(`nothing sticks out at ${width} px, ${scheme}`, inner <= outer, `${inner} of ${outer} px`);
    const seen = await page.evaluate(() => {
      scrollTo(0, 0);
      const { top, bottom, height } = document.getElementById("cloth").getBoundingClientRect();
      const end = document.getElementById("transport").getBoundingClientRect().top;
      return (Math.min(bottom, end) - Math.max(0, top)) / height;
    });
    check(`the fabric is on the first screen at ${width} px, ${scheme}`, seen > 0.8,
      `${(100 * seen).toFixed(0)} % of its view`);
    if (shots) {
      await page.evaluate(() => scrollTo(0, 0));
      await page.screenshot({ path: `${shots}/${width}-${scheme}.png` });
      await page.screenshot({ path: `${shots}/${width}-${scheme}-all.png`, fullPage: true });
    }
  }
}
if (shots) {
  await page.setViewport({ width: 1280, height: 900 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }]);
  for (const look of looks) {
    await page.select("#look", look);
    await pause(200);
    await (await page.$("#cloth-panel")).screenshot({ path: `${shots}/look-${look}.png` });
  }
  for (const layer of await page.$$eval("#layer option", all => all.map(o => o.value))) {
    await page.select("#layer", layer);
    await pause(200);
    await (await page.$("#film-panel")).screenshot({ path: `${shots}/film-${layer.replace(":", "-")}.png` });
  }
  await page.select("#look", looks[0]);
  await page.click("#through-camera");
  await page.$eval("#scrub", e => { e.value = 30; e.dispatchEvent(new Event("input")); });
  await pause(300);
  await page.screenshot({ path: `${shots}/camera.png` });
}
check("no complaint in the console", complaints.length === 0, complaints.join(" | "));
check("nothing asked of the network", requests.filter(r => !r.startsWith(address)).length === 0, requests.join(" "));
await browser.close();
process.exit(failures > 0 ? 1 : 0);
