/** Step 3: outline, size and camera, and the commands that make scene, masks and template of them. */
import { byId, fileUrl, loadImage, number } from "./api.js";
import { outline } from "./outline.js";

/** Field of view of a phone's main camera along the longer side [degrees]. */
const PHONE = 65;
const UNITS = { mm: 1e-3, cm: 1e-2, m: 1 };
const NOTES = {
  auto: "Taken from the clip if it names its lens, else from the four corners of the sheet, which must then be tilted.",
  guess: "A guess for a phone's main camera: the distance may be off by a fifth, the shape by much less.",
  fov: "A phone's main camera sees 50 to 70 degrees along the longer side.",
  focal: "Pixels of the clip; the centre of the first pixel is 0.",
  file: "OpenCV (YAML, JSON), COLMAP cameras.txt or nerfstudio transforms.json.",
};

export const fabric = studio => {
  const wait = byId("outline-wait"), next = byId("fabric-next"), unit = byId("unit"), camera = byId("camera");
  const ends = [byId("from-point"), byId("to-point")], shapes = [...document.getElementsByName("shape")];
  let shown = null, loaded = null, asked = null, entered = 0;

  const isOther = () => studio.form?.shape === "other";

  const drawing = outline(byId("outline"), (points, closed) => {
    const before = isOther() ? studio.form.closed : studio.form.outline.filter(p => p.corner).length === 4;
    studio.change({ outline: points.map(p => ({ ...p })), closed });
    // After the click, which would take the focus to the drawing.
    const lacks = isOther() ? !studio.form.distance : !studio.form.size;
    if (!before && drawing.complete() && lacks)
      setTimeout(() => byId(isOther() ? "distance" : "width").focus());
    showEnds();
    tell();
  });

  /** The points by their numbers, and those between which was measured. */
  const showEnds = () => {
    const points = studio.form.outline, measured = points.flatMap((p, k) => p.measured ? [k] : []);
    ends.forEach((select, end) => {
      if (select.options.length !== points.length + 1)
        select.replaceChildren(new Option("–", ""), ...points.map((_, k) => new Option(k + 1, k)));
      select.value = measured[end] ?? "";
    });
  };

  const showShape = () => {
    const shape = studio.form.shape;
    for (const radio of shapes) radio.checked = radio.value === shape;
    for (const part of document.querySelectorAll("[data-shape]")) part.hidden = part.dataset.shape !== shape;
  };

  const lengths = () => ["width", "height"].map(id => number(byId(id).value));
  /** Of another shape the lens has to be known. */
  const lensUnknown = () => isOther() && studio.form.camera.kind === "auto" && Boolean(studio.form.clip)
    && typeof studio.state?.work?.clip?.lens !== "number";

  const missingOther = () => {
    const { outline: points, closed, distance } = studio.form;
    if (!closed) return points.length < 3 ? `Click around the fabric: ${points.length} points` : "Close the outline";
    if (points.filter(p => p.measured).length !== 2) return "Choose the two points";
    if (!(distance > 0)) return "Enter the measured distance";
    return lensUnknown() ? "Enter the camera" : null;
  };

  const missing = () => {
    if (isOther()) return missingOther();
    const corners = drawing.corners(), [w, h] = lengths();
    if (corners < 4) return `Click the corners: ${corners} of 4`;
    return w > 0 && h > 0 ? null : "Enter the size of the sheet";
  };

  const tell = () => {
    if (!studio.form) return;
    const lack = missing(), texts = [byId("width").value, byId("height").value];
    const wrong = texts.find(text => text.trim() !== "" && !(number(text) > 0));
    byId("size-note").hidden = wrong === undefined;
    byId("size-note").textContent = `“${wrong}” is no length: write a number such as 55 or 55.5`;
    const far = byId("distance").value, isLength = far.trim() === "" || number(far) > 0;
    byId("distance-note").hidden = isLength;
    byId("distance-note").textContent = `“${far}” is no length: write a number such as 62 or 62.5`;
    drawing.measured(isOther() && studio.form.distance > 0 ? `${far.trim()} ${byId("distance-unit").value}` : "");
    byId("close-outline").disabled = studio.form.closed || studio.form.outline.length < 3;
    if (isOther()) {
      byId("camera-guess").hidden = !lensUnknown() || camera.value !== "auto";
      byId("camera-why").textContent = "This outline does not show the lens.";
    }
    const count = isOther() ? studio.form.outline.length : drawing.corners();
    byId("outline-hint").textContent = isOther()
      ? studio.form.closed ? "This is the first mask: drag what is not right."
      : count === 0 ? "Click points around the whole fabric, where its border bends."
      : "Go on around the fabric; click the first point again to close the outline."
      : count === 0 ? "Click its four corners."
      : count < 4 ? `${4 - count} more.`
      : "Is “width” on the side you measured as width? If not, click “Next side is the width”.";
    const running = studio.state.work.job?.running;
    next.disabled = Boolean(lack || running);
    const makes = studio.form?.masks ? "Take the masks" : "Make the masks";
    next.textContent = lack ?? (studio.state.work.scene ? `${makes} anew` : makes);
  };

  const guessed = () => camera.value === "fov" && studio.form?.camera.guess;

  const showCamera = () => {
    if (camera.value !== "auto") byId("camera-guess").hidden = true;
    for (const part of document.querySelectorAll("[data-camera]")) part.hidden = part.dataset.camera !== camera.value;
    const lens = studio.state?.work?.clip?.lens;
    byId("camera-note").textContent = camera.value === "auto" && lens
      ? `The clip says ${lens} mm in terms of 35-mm film; videos often see a little less.`
      : NOTES[guessed() ? "guess" : camera.value];
  };

  const keepCamera = () => {
    showCamera();
    const value = id => { const v = number(byId(id).value); return Number.isNaN(v) ? null : v; };
    const centre = value("cx") !== null && value("cy") !== null ? [value("cx"), value("cy")] : null;
    const chosen = {
      auto: { kind: "auto" },
      fov: value("fov") ? { kind: "fov", fov: value("fov") } : null,
      focal: value("fx") ? { kind: "focal", fx: value("fx"), fy: value("fy"), centre } : null,
      file: byId("camera-file").value.trim() ? { kind: "file", file: byId("camera-file").value.trim() } : null,
    }[camera.value];
    if (chosen) studio.change({ camera: chosen });
    showCamera();
    tell();
  };

  byId("guess").addEventListener("click", () => {
    const { width, height } = studio.state.work.clip ?? { width: 1, height: 1 };
    const across = 2 * Math.atan(Math.tan(PHONE * Math.PI / 360) * Math.min(1, width / height)) * 180 / Math.PI;
    camera.value = "fov";
    byId("fov").value = across.toFixed(1);
    studio.change({ camera: { kind: "fov", fov: Number(across.toFixed(1)), guess: true } });
    showCamera();
    tell();
    next.focus();
  });

  const keepSize = () => {
    const [w, h] = lengths(), far = number(byId("distance").value), scale = UNITS[unit.value];
    byId("distance-unit").value = unit.value;
    studio.change({
      size: w > 0 && h > 0 ? [w * scale, h * scale] : null,
      distance: far > 0 ? far * scale : null,
      unit: unit.value,
    });
    tell();
  };

  const keepEnds = () => {
    const chosen = ends.filter(select => select.value !== "").map(select => Number(select.value));
    drawing.measure(chosen);
  };

  const show = form => {
    const scale = UNITS[form.unit];
    unit.value = form.unit;
    ["width", "height"].forEach((id, k) => {
      byId(id).value = form.size ? Number((form.size[k] / scale).toFixed(4)) : "";
    });
    byId("distance-unit").value = form.unit;
    byId("distance").value = form.distance ? Number((form.distance / scale).toFixed(4)) : "";
    camera.value = form.camera.kind;
    byId("fov").value = form.camera.fov ?? "";
    byId("fx").value = form.camera.fx ?? "";
    byId("fy").value = form.camera.fy ?? "";
    [byId("cx").value, byId("cy").value] = form.camera.centre ?? ["", ""];
    byId("camera-file").value = form.camera.file ?? "";
    byId("masks-file").value = form.masks ?? "";
    byId("object").value = form.object ?? "";
    byId("masks-box").open = Boolean(form.masks);
    showCamera();
    drawing.set(form.outline, form);
    showShape();
    showEnds();
  };

  const keepMasks = () => {
    const [masks, object] = ["masks-file", "object"].map(id => byId(id).value.trim().replace(/\/+$/, "") || null);
    studio.change({ masks, object: masks ? object : null });
    tell();
  };

  /** The first frame: of the clip as it will be imported, or of the scene. */
  const image = async (work, form) => {
    const start = form.frames?.[0] ?? 0;
    if (form.clip) {
      if (work.first !== start) {
        const failed = work.job?.step === "first" && work.job.ended === "failed";
        if (!work.job?.running && !failed && asked !== start) {
          asked = start;
          if (await studio.auto({ step: "first" }) === "busy") asked = null;
        }
        return;
      }
      await put(`${work.first_folder}/frame_${String(start).padStart(5, "0")}.png`, `${form.clip}${start}`);
    } else if (work.scene && loaded === null) {
      const { frames } = await studio.frames();
      if (frames.length) await put(frames[0], work.scene_version);
    }
  };
  const put = async (name, version) => {
    const key = `${name}?${version}`;
    if (loaded === key) return;
    loaded = key;
    const found = await loadImage(fileUrl(name, version));
    wait.hidden = true;
    drawing.show(found);
  };

  for (const id of ["width", "height", "distance"]) byId(id).addEventListener("input", keepSize);
  unit.addEventListener("change", keepSize);
  byId("distance-unit").addEventListener("change", () => {
    unit.value = byId("distance-unit").value;
    keepSize();
  });
  for (const select of ends) select.addEventListener("change", keepEnds);
  for (const radio of shapes) radio.addEventListener("change", () => {
    studio.change({ shape: radio.value });
    byId("camera-guess").hidden = true;
    showShape();
    drawing.reshape(isOther());
    showEnds();
    tell();
  });
  camera.addEventListener("change", keepCamera);
  for (const id of ["fov", "fx", "fy", "cx", "cy", "camera-file"]) byId(id).addEventListener("input", keepCamera);
  for (const id of ["masks-file", "object"]) byId(id).addEventListener("input", keepMasks);
  byId("undo").addEventListener("click", drawing.undo);
  byId("clear").addEventListener("click", drawing.clear);
  byId("close-outline").addEventListener("click", drawing.close);
  byId("turn").addEventListener("click", drawing.turn);
  byId("side").addEventListener("submit", e => {
    e.preventDefault();
    if (!missing()) studio.run({ step: "prepare" }).catch(studio.alarm);
  });

  return {
    enter: drawing.draw,
    /** The masks hold several objects. */
    askObject() {
      byId("masks-box").open = true;
      byId("object").focus();
    },
    /** The camera moved: `commands` are [when it helps, command]. */
    offerMotion(commands) {
      byId("motion-offer").hidden = !commands;
      byId("motion-commands").replaceChildren(...(commands ?? []).flatMap(([when, command]) => {
        const [name, text] = ["dt", "dd"].map(tag => document.createElement(tag));
        name.textContent = when;
        text.append(Object.assign(document.createElement("pre"), { textContent: command }));
        return [name, text];
      }));
    },
    /** The lens could not be found out. */
    askLens() {
      byId("camera-why").textContent = "The corners do not show the lens.";
      byId("camera-guess").hidden = false;
      camera.focus();
    },
    key(e) {
      if (!(e.ctrlKey || e.metaKey) || e.key !== "z" || document.activeElement.tagName === "INPUT") return false;
      drawing.undo();
      return true;
    },
    update({ work }, form) {
      if (shown !== work.name) {
        byId("motion-offer").hidden = true;
        shown = work.name;
        loaded = asked = null;
        wait.hidden = false;
      }
      if (entered !== studio.shown) {
        entered = studio.shown;
        show(form);
      }
      if (form.clip && asked !== null && asked !== (form.frames?.[0] ?? 0)) asked = null;
      image(work, form).catch(studio.alarm);
      tell();
    },
  };
};
