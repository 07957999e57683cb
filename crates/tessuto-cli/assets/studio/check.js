/** Step 4: masks and template on the frames; clicks that mend masks. */
import { byId, fileUrl } from "./api.js";
import { loadMesh, overlay } from "./overlay.js";

const SURE = 0.5;

/** Warnings and errors of the latest check, with their ways out: rows of its table, whose later lines are indented. */
const remarks = text => {
  const found = [];
  for (const line of text.slice(text.lastIndexOf("\nok ") < 0 ? 0 : text.lastIndexOf("ok       frames")).split("\n")) {
    const row = /^(ok|warning|error) +(\S+) +(.*)$/.exec(line);
    if (row) found.push({ level: row[1], text: row[3] });
    else if (/^ {8,}/.test(line) && found.length)
      found.at(-1).text += `${/^ +hint:/.test(line) ? "\n" : " "}${line.trim()}`;
  }
  return found.filter(f => f.level !== "ok");
};

const remark = ({ level, text }) => {
  const item = document.createElement("li"), word = document.createElement("b");
  word.textContent = level;
  word.className = level;
  item.append(word, text);
  return item;
};

export const check = studio => {
  const canvas = byId("overlay"), slider = byId("check-frame"), strip = byId("confidence");
  const view = overlay(canvas);
  let work = null, version = "", mesh = null, meshVersion = null, pending = [];
  const frames = () => work?.masks?.frames ?? [];
  const isDoubtful = f => Boolean(f.reason) || f.confidence < SURE;
  const at = () => Number(slider.value);

  const draw = () => {
    const frame = at();
    view.draw({
      frame, mask: byId("show-mask").checked, mesh: byId("show-mesh").checked && frame === 0 ? mesh : null,
      camera: work.scene, clicks: [...(work.masks?.clicks ?? []), ...pending],
    }).catch(studio.alarm);
    const told = frames()[frame];
    const sure = told ? ` · ${Math.round(100 * told.confidence)} % sure${told.reason ? `: ${told.reason}` : ""}` : "";
    byId("check-text").textContent = `frame ${frame} of ${view.count}${sure}`;
  };

  /** How sure the masks are, over the frames: height shows it as well as colour. */
  const drawStrip = () => {
    const all = frames();
    strip.hidden = all.length === 0;
    const dense = devicePixelRatio || 1, pen = strip.getContext("2d"),
      style = getComputedStyle(document.documentElement);
    strip.width = strip.clientWidth * dense;
    strip.height = 14 * dense;
    const wide = strip.width / Math.max(1, all.length);
    all.forEach((f, k) => {
      pen.fillStyle = style.getPropertyValue(isDoubtful(f) ? "--alarm-rule" : "--accent");
      const high = Math.max(0.08, f.confidence) * strip.height;
      pen.fillRect(k * wide, strip.height - high, Math.max(1, wide - dense), high);
    });
  };

  const tell = () => {
    const all = frames(), doubtful = all.filter(isDoubtful).length, running = work.job?.running;
    byId("doubtful").hidden = doubtful === 0;
    byId("check-lead").textContent = doubtful
      ? "The yellow line should follow the fabric. " +
        `${doubtful} of ${all.length} masks are doubtful: look at those first.`
      : "The yellow line should follow the fabric in every frame, the mesh in the first one.";
    byId("masks-next").disabled = pending.length === 0 || Boolean(running);
    byId("masks-undo").disabled = pending.length === 0;
    byId("check-next").disabled = !work.template_version || Boolean(running);
    byId("check-next").textContent = work.result ? "Reconstruct again" : "Start the reconstruction";
    const found = remarks(work.findings ?? ""), t = work.template;
    const residual = typeof t?.residual === "number" ? ` The sheet's corners fit to ${t.residual.toFixed(1)} px.` : "";
    const seen = t?.camera?.interval
      ? ` Focal length ${t.camera.fx.toFixed(0)} px, ${t.camera.interval.map(v => v.toFixed(0)).join(" to ")}.` : "";
    byId("template-box").hidden = !work.template_version;
    byId("template-text").textContent = `${found.length ? "" : "Nothing to complain of."}${residual}${seen}`.trim();
    byId("findings").textContent = work.findings ?? "";
    const said = found.map(f => f.level + f.text).join("");
    if (byId("remarks").textContent !== said) byId("remarks").replaceChildren(...found.map(remark));
  };

  const toggle = id => byId(id).addEventListener("change", draw);
  ["show-mask", "show-mesh"].forEach(toggle);
  slider.addEventListener("input", draw);
  const doubt = () => {
    const all = frames(), order = all.map((_, k) => (at() + 1 + k) % all.length);
    const found = order.find(k => isDoubtful(all[k]));
    if (found !== undefined) { slider.value = found; draw(); }
  };
  byId("doubtful").addEventListener("click", doubt);
  canvas.addEventListener("click", e => {
    if (view.shown !== at()) return;
    const inside = document.querySelector("input[name=click]:checked").value === "inside";
    pending.push({ frame: at(), ...view.toImage(e), inside });
    draw();
    tell();
  });
  byId("masks-undo").addEventListener("click", () => { pending.pop(); draw(); tell(); });
  byId("masks-next").addEventListener("click", async () => {
    const bare = inside => pending.filter(c => c.inside === inside).map(({ frame, x, y }) => ({ frame, x, y }));
    try {
      await studio.run({ step: "masks", inside: bare(true), outside: bare(false), forget: false });
      pending = [];
    } catch (error) {
      studio.alarm(error);
    }
  });
  byId("appearance").addEventListener("change", e => studio.change({ appearance: e.target.checked }));
  byId("check-next").addEventListener("click",
    () => studio.run({ step: "reconstruct" }).then(() => studio.go("run")).catch(studio.alarm));
  addEventListener("resize", () => { if (studio.step === "check" && work) { draw(); drawStrip(); } });

  return {
    enter() { if (work && view.count) { draw(); drawStrip(); } },
    key(e) {
      const choose = { i: "inside", o: "outside" }[e.key.toLowerCase()];
      const move = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
      const typing = document.activeElement.tagName === "INPUT" && document.activeElement !== slider;
      if (choose) document.querySelector(`input[name=click][value=${choose}]`).checked = true;
      else if (e.key.toLowerCase() === "n") doubt();
      else if (move && !typing && document.activeElement !== slider) { slider.value = at() + move; draw(); }
      else return false;
      return true;
    },
    async update(state, form) {
      if (work?.name !== state.work.name) pending = [];
      work = state.work;
      byId("appearance").checked = form.appearance;
      const files = `${work.name} ${work.scene_version} ${work.masks_version}`;
      if (work.scene && version !== files) {
        version = files;
        view.set(await studio.frames(), `${work.scene_version}-${work.masks_version}`);
        slider.max = Math.max(0, view.count - 1);
        if (at() > view.count - 1) slider.value = 0;
        if (studio.step === "check") { draw(); drawStrip(); }
      }
      const meshFile = `${work.name} ${work.template_version}`;
      if (work.template_version && meshVersion !== meshFile) {
        meshVersion = meshFile;
        mesh = await loadMesh(fileUrl(`${work.name}/template.obj`, work.template_version));
        if (studio.step === "check") draw();
      }
      tell();
    },
  };
};
