// Drives a headless Chromium over the DevTools protocol, by a pipe: no package is needed.
// CHROMIUM=program names another one than /usr/bin/chromium.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const pause = ms => new Promise(done => setTimeout(done, ms));

/** Keys that are not a character. */
const KEYS = {
  Enter: 13, Escape: 27, Tab: 9, ArrowLeft: 37, ArrowUp: 38, ArrowRight: 39, ArrowDown: 40, Delete: 46, Home: 36,
  End: 35, Backspace: 8,
};

/** A browser with one page; `complaints` collects errors of its console and refused requests. */
export const launch = async () => {
  const profile = mkdtempSync(join(tmpdir(), "chromium-"));
  const child = spawn(process.env.CHROMIUM ?? "/usr/bin/chromium", [
    "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--no-first-run", "--disable-extensions",
    "--disable-background-networking",
    "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    `--user-data-dir=${profile}`, "about:blank",
  ], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  const waiting = new Map(), listeners = new Map(), complaints = [];
  let last = 0, session, text = "";
  child.on("exit", () => waiting.forEach(({ failed }) => failed(new Error("Chromium has ended"))));
  child.stdio[4].setEncoding("utf8").on("data", data => {
    const messages = (text + data).split("\0");
    text = messages.pop();
    for (const message of messages.map(m => JSON.parse(m))) {
      const call = waiting.get(message.id);
      waiting.delete(message.id);
      if (call) message.error ? call.failed(new Error(`${call.method}: ${message.error.message}`))
        : call.done(message.result);
      else listeners.get(message.method)?.(message.params);
    }
  });
  const send = (method, params = {}, to = session) => new Promise((done, failed) => {
    const id = ++last;
    waiting.set(id, { done, failed, method });
    child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId: to })}\0`);
  });
  const on = (method, listener) => listeners.set(method, listener);

  const { targetId } = await send("Target.createTarget", { url: "about:blank" }, undefined);
  ({ sessionId: session } = await send("Target.attachToTarget", { targetId, flatten: true }, undefined));
  for (const domain of ["Page", "Runtime", "Log", "DOM", "Network"]) await send(`${domain}.enable`);
  on("Runtime.exceptionThrown", ({ exceptionDetails: e }) =>
    complaints.push(e.exception?.description ?? e.text));
  on("Log.entryAdded", ({ entry }) => {
    if (entry.level === "error") complaints.push(`${entry.text} ${entry.url ?? ""}`);
  });
  on("Runtime.consoleAPICalled", e => { if (e.type === "error") complaints.push(e.args.map(a => a.value).join(" ")); });

  /** The value of an expression in the page. */
  const evaluate = async expression => {
    const { result, exceptionDetails } = await send("Runtime.evaluate",
      { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  };
  const waitFor = async (expression, what, seconds = 30) => {
    const until = Date.now() + 1000 * seconds;
    while (!(await evaluate(`Boolean(${expression})`).catch(() => false))) {
      if (Date.now() > until) throw new Error(`waited ${seconds} s for ${what}`);
      await pause(40);
    }
  };
  const mouse = (type, x, y, more = {}) => send("Input.dispatchMouseEvent", { type, x, y, button: "none", ...more });
  const page = {
    send, on, evaluate, waitFor, complaints,
    clicks: 0,
    keys: 0,
    entries: 0,
    go: url => send("Page.navigate", { url }),
    /** Clicks a place of the window. */
    async clickAt(x, y) {
      page.clicks++;
      await mouse("mouseMoved", x, y);
      await mouse("mousePressed", x, y, { button: "left", clickCount: 1 });
      await mouse("mouseReleased", x, y, { button: "left", clickCount: 1 });
    },
    /** Scrolls an element into sight; its box in the window. */
    box: selector => evaluate(`(() => {
      const e = document.querySelector(${JSON.stringify(selector)});
      e.scrollIntoView({ block: "center" });
      const { x, y, width, height } = e.getBoundingClientRect();
      return { x, y, width, height };
    })()`),
    /** Clicks the middle of an element, which must be there, enabled, and not covered. */
    async click(selector) {
      const found = `document.querySelector(${JSON.stringify(selector)})`;
      await waitFor(`(e => e && !e.disabled && e.getClientRects().length)(${found})`, `${selector} to be clickable`);
      const { x, y, width, height } = await page.box(selector), [cx, cy] = [x + width / 2, y + height / 2];
      const hit = await evaluate(`(e => {
        const h = document.elementFromPoint(${cx}, ${cy});
        return e === h || e.contains(h) || Boolean(h?.contains(e));
      })(${found})`);
      if (!hit) throw new Error(`${selector} is covered`);
      await page.clickAt(cx, cy);
    },
    async drag([x0, y0], [x1, y1]) {
      page.clicks++;
      await mouse("mouseMoved", x0, y0);
      await mouse("mousePressed", x0, y0, { button: "left", clickCount: 1, buttons: 1 });
      for (const t of [0.5, 1]) await mouse("mouseMoved", x0 + t * (x1 - x0), y0 + t * (y1 - y0),
        { button: "left", buttons: 1 });
      await mouse("mouseReleased", x1, y1, { button: "left", clickCount: 1 });
    },
    /** Types a number or a word into what has the focus. */
    type(string) {
      page.keys += string.length;
      page.entries++;
      return send("Input.insertText", { text: string });
    },
    async press(key, modifiers = 0) {
      page.keys++;
      const code = KEYS[key] ?? key.toUpperCase().charCodeAt(0);
      const text = key in KEYS ? (key === "Enter" ? "\r" : undefined) : modifiers ? undefined : key;
      await send("Input.dispatchKeyEvent", { type: "keyDown", key, text, windowsVirtualKeyCode: code, modifiers });
      await send("Input.dispatchKeyEvent", { type: "keyUp", key, windowsVirtualKeyCode: code, modifiers });
    },
    /** What the file chooser, once opened, gives back. */
    async chooseFile(file, open) {
      await send("Page.setInterceptFileChooserDialog", { enabled: true });
      const opened = new Promise(done => on("Page.fileChooserOpened", done));
      await open();
      const { backendNodeId } = await opened;
      await send("DOM.setFileInputFiles", { files: [file], backendNodeId });
      await send("Page.setInterceptFileChooserDialog", { enabled: false });
    },
    async look(width, scheme) {
      await send("Emulation.setDeviceMetricsOverride", { width, height: 800, deviceScaleFactor: 1, mobile: false });
      await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
      await pause(150);
    },
    async shot(file) {
      const { data } = await send("Page.captureScreenshot", { format: "png" });
      writeFileSync(file, Buffer.from(data, "base64"));
    },
    async close() {
      const gone = new Promise(done => child.once("exit", done));
      await send("Browser.close", {}, undefined).catch(() => {});
      await Promise.race([gone, pause(5000)]);
      child.kill("SIGKILL");
      rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
    },
  };
  return page;
};
