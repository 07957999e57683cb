/** The steps, and what they share: the state on the server, what was entered, errors. */
import { byId, get, post } from "./api.js";
import { begin } from "./begin.js";
import { check } from "./check.js";
import { fabric } from "./fabric.js";
import { result } from "./result.js";
import { run } from "./run.js";
import { trim } from "./trim.js";

const QUICK = 400, SLOW = 3000;
const WAITS = {
  preview: "Reading the clip …", first: "Reading the first frame …", prepare: "Making the scene …",
  masks: "Making masks …", export: "Writing files …",
};
const WORDS = [
  ["import", "Reading the frames and making masks …"], ["masks", "Making masks …"],
  ["template", "Fitting the sheet …"], ["check", "Looking at all of it …"],
];

const CONFLICT = 409;

const query = () => studio.name ? `?work=${encodeURIComponent(studio.name)}` : "";

const studio = {
  name: null, state: null, form: null, step: "clip",
  /** Changes whenever another form is to be shown than the one that was entered here. */
  shown: 0,
  /** Takes up a clip, scene or result. */
  async open(name) {
    await flush();
    const { work } = await post("/api/open", { name });
    [studio.name, studio.form, version] = [work, null, null];
    history.replaceState(null, "", `#${work}`);
    await refresh();
    studio.go(furthest(studio.state.work));
  },
  go(step) {
    if (views[studio.step].leave) views[studio.step].leave();
    studio.step = step;
    for (const name of Object.keys(views)) byId(name).hidden = name !== step;
    show();
    if (views[step].enter) views[step].enter();
    scrollTo(0, 0);
  },
  /** Keeps something that was entered. */
  change(part) {
    Object.assign(studio.form, part);
    clearTimeout(saving);
    saving = setTimeout(() => flush().catch(studio.alarm), 250);
    unsaved = true;
  },
  /** Starts the commands of a step. */
  async run(step) {
    calm();
    await begun(step);
  },
  frames: () => get(`/api/frames${query()}`),
  /**
   * Starts a step that nobody clicked; "busy" where another command runs, after which it can be asked for
   * again. One request at a time: what asks is called whenever the state is shown, and the state does not know
   * of a request on its way.
   */
  async auto(step) {
    if (asking) return "busy";
    asking = true;
    try {
      await begun(step);
      return "started";
    } catch (error) {
      if (error.status === CONFLICT) return "busy";
      studio.alarm(error);
      return "failed";
    } finally {
      asking = false;
    }
  },
  alarm(error) {
    byId("alarm").hidden = false;
    byId("alarm").firstElementChild.textContent = error.message;
  },
};
let saving = 0, unsaved = false, sent = Promise.resolve(), timer = 0, started = null, lost = 0, asking = false,
  sending = 0, version = null;
const calm = () => { byId("alarm").hidden = true; };

const begun = async step => {
  await flush();
  await post(`/api/run${query()}`, step);
  started = step.step;
  await refresh();
};

/** Sends what is not yet saved, after what is on its way: the last to be sent is the last to be kept. */
const flush = () => {
  clearTimeout(saving);
  if (unsaved) {
    unsaved = false;
    const form = structuredClone(studio.form), name = studio.name, work = query();
    sending++;
    sent = sent.catch(() => {}).then(async () => {
      const base = version ? `&base=${version}` : "";
      const answer = await post(`/api/save${work}${base}`, form);
      if (studio.name === name) version = answer.form_version;
    }).catch(async error => {
      if (error.status !== CONFLICT || studio.name !== name) unsaved = studio.name === name;
      else {
        await adopt(name);
        // Told once: what is entered from now on is saved again.
        sent = Promise.resolve();
      }
      throw error;
    }).finally(() => { sending--; });
  }
  return sent;
};

/** Another window has changed the form: this one shows it. */
const adopt = async name => {
  const { work } = await get(`/api/state${query()}`);
  if (studio.name !== name || unsaved) return;
  [studio.form, version] = [work.form, work.form_version];
  studio.shown++;
  await refresh();
};

const views = {
  clip: begin(studio), trim: trim(studio), fabric: fabric(studio), check: check(studio),
  run: run(studio), result: result(studio),
};

/** The step that is next, from what is there. */
const furthest = work => {
  const step = work.job?.running ? work.job.step : null;
  if (step === "reconstruct") return "run";
  if (work.result !== null || work.is_result) return "result";
  if (work.interrupted) return "run";
  if (work.scene && work.template_version) return "check";
  if (work.scene && !work.form.clip || work.form.outline.length || step === "prepare") return "fabric";
  return "trim";
};

/** Which steps there are for this work, which are done, and what stands below their names. */
const steps = () => {
  const work = studio.state.work, form = studio.form;
  if (!work) return { clip: [true, false, ""] };
  const prepared = Boolean(work.scene && work.template_version), there = work.result !== null;
  const size = form.shape === "other" ? form.distance ? `${(form.distance * 100).toFixed(1)} cm measured` : ""
    : form.size ? `${(form.size[0] * 100).toFixed(1)} × ${(form.size[1] * 100).toFixed(1)} cm` : "";
  const doubtful = (work.masks?.frames ?? []).filter(f => f.reason).length;
  return {
    clip: [true, true, form.clip?.split("/").at(-1) ?? ""],
    trim: [
      Boolean(form.clip),
      Boolean(work.clip && (form.frames || form.outline.length)),
      form.frames ? `${form.frames[1] - form.frames[0]} frames` : work.clip ? `${work.clip.frames[1]} frames` : "",
    ],
    fabric: [!work.is_result && Boolean(work.clip || work.scene), prepared, size],
    check: [
      prepared,
      prepared && (there || work.interrupted),
      work.masks ? (doubtful ? `${doubtful} doubtful` : "masks are fine") : "",
    ],
    run: [
      prepared,
      there,
      work.job?.step === "reconstruct" && work.job.running ? `${Math.round(100 * (work.job.fraction ?? 0))} %`
        : work.interrupted ? "interrupted" : "",
    ],
    result: [there, there && work.exports.length > 0, work.summary?.verdict?.state ?? ""],
  };
};

const show = () => {
  const { state, form } = studio, work = state.work;
  byId("project").textContent = byId("project").title = state.project;
  byId("work-name").textContent = work?.name.split("/").at(-1) ?? "";
  document.title = `${work ? `${work.name.split("/").at(-1)} · ` : ""}tessuto studio`;
  const known = steps();
  for (const button of document.querySelectorAll("#steps button")) {
    const [open, done, text] = known[button.dataset.step] ?? [false, false, ""];
    button.disabled = !open;
    button.classList.toggle("done", done && button.dataset.step !== studio.step);
    button.toggleAttribute("aria-current", button.dataset.step === studio.step);
    button.querySelector("small").textContent = text;
  }
  for (const box of document.querySelectorAll("[data-commands]")) {
    const commands = work?.commands[box.dataset.commands];
    box.hidden = !commands;
    box.querySelector("pre").textContent = (commands ?? []).join("\n");
  }
  for (const box of document.querySelectorAll("[data-job]")) {
    const running = work?.job?.running && work.job.step === box.dataset.job;
    box.hidden = !running;
    if (!running) continue;
    const bar = box.querySelector("progress");
    if (box.dataset.command === work.job.command && bar) {
      if (typeof work.job.fraction === "number") bar.value = work.job.fraction;
      continue;
    }
    box.dataset.command = work.job.command;
    const word = WORDS.find(([name]) => work.job.command.startsWith(`tessuto ${name} `))?.[1] ?? WAITS[work.job.step];
    box.replaceChildren(word, document.createElement("progress"));
  }
  if (studio.step === "clip") views.clip.update(state);
  else if (work) for (const name of ["trim", "fabric", "check", "run", "result"])
    if (name === studio.step || name === "check") views[name].update(state, form);
};

/** A command has ended: its error is shown, or the next step. */
const ended = job => {
  started = null;
  if (job.ended === "failed") {
    const table = job.text.split("\n").filter(line => /^error\b/.test(line)).join("\n");
    if (job.step === "prepare" && studio.form?.camera.kind === "auto"
      && /focal length|camera is not given/.test(job.error ?? "")) views.fabric.askLens();
    if (job.step === "prepare" && /did not stand still/.test(job.error ?? ""))
      views.fabric.offerMotion(studio.state.work.commands.moving);
    if (job.step === "prepare" && /--object|objects?: /.test(job.error ?? "")) views.fabric.askObject();
    return studio.alarm(new Error(`${job.error ?? (table || `${job.command}: ended without a message`)}`));
  }
  if (job.ended !== "ok") return;
  if (job.step === "prepare" && studio.step === "fabric") studio.go("check");
  if (job.step === "reconstruct" && studio.step === "run") studio.go("result");
};

const refresh = async () => {
  const asked = studio.name, state = await get(`/api/state${query()}`);
  if (asked !== studio.name) return;
  studio.state = state;
  const elsewhere = studio.form && !unsaved && sending === 0 && state.work && state.work.form_version !== version;
  if (!studio.form || elsewhere) {
    [studio.form, version] = [state.work?.form ?? null, state.work?.form_version ?? null];
    studio.shown++;
  }
  lost = 0;
  show();
  const job = state.work?.job;
  if (started && job?.step === started && !job.running && job.ended) ended(job);
};

const loop = async () => {
  clearTimeout(timer);
  try {
    if (!document.hidden) await refresh();
  } catch (error) {
    if (++lost === 3) studio.alarm(new Error("The studio does not answer. " +
      "What is done is kept: start it again in the same folder, and open the address that it prints."));
  }
  timer = setTimeout(loop, studio.state?.work?.job?.running ? QUICK : SLOW);
};

for (const button of document.querySelectorAll("#steps button")) {
  button.addEventListener("click", () => {
    calm();
    if (button.dataset.step === "clip") byId("home").click();
    else studio.go(button.dataset.step);
  });
}
byId("home").addEventListener("click", async () => {
  await flush().catch(studio.alarm);
  [studio.name, studio.form, version] = [null, null, null];
  history.replaceState(null, "", "#");
  await refresh().catch(studio.alarm);
  studio.go("clip");
});
byId("alarm").lastElementChild.addEventListener("click", calm);
addEventListener("keydown", e => {
  if (e.key === "Escape") calm();
  if (e.altKey || ["TEXTAREA"].includes(document.activeElement.tagName)) return;
  if (views[studio.step].key?.(e)) e.preventDefault();
});
addEventListener("beforeunload", () => { if (unsaved) flush(); });

// The token has become a cookie: it need not stand in the address.
const wanted = decodeURIComponent(location.hash.slice(1));
history.replaceState(null, "", `/${location.hash}`);
try {
  await refresh();
  const start = wanted || studio.state.start;
  if (start) await studio.open(start); else studio.go("clip");
} catch (error) {
  studio.alarm(error);
  studio.go("clip");
}
document.body.dataset.ready = "true";
loop();
