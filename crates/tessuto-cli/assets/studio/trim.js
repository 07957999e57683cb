/** Step 2: the part of the clip, chosen on small frames that are numbered as the import numbers them. */
import { byId, fileUrl, fitCanvas, loadImage, number } from "./api.js";

const THUMBS = 14, LONG = 300;

export const trim = studio => {
  const canvas = byId("trim-canvas"), strip = byId("thumbs"), start = byId("trim-start"), end = byId("trim-end");
  const play = byId("trim-play"), images = new Map();
  let clip = null, shown = 0, timer = 0, folder = "", failed = null, form = 0;

  const frame = n => {
    const name = `${folder}/frame_${String(n).padStart(5, "0")}.jpg`;
    if (!images.has(n)) images.set(n, loadImage(fileUrl(name, studio.state.work.form.clip)));
    return images.get(n);
  };
  const range = () => [Number(start.value), Number(end.value)];

  const show = async n => {
    shown = n;
    const image = await frame(n).catch(() => null);
    if (!image || shown !== n) return;
    fitCanvas(canvas, clip.width, clip.height, 0.5);
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
  };

  const tell = () => {
    const [a, b] = range(), count = Math.ceil((b - a + 1) / Number(byId("stride").value));
    const seconds = ((b - a + 1) / clip.fps).toFixed(2);
    const long = count > LONG ? " · one or two seconds are enough, and much faster" : "";
    byId("trim-text").textContent = `frames ${a} to ${b} of ${clip.frames[1]} · ` +
      `${count} used · ${seconds} s of ${clip.fps.toFixed(2)} per second${long}`;
    byId("trim-next").textContent = a === 0 && b === clip.frames[1] - 1 ? "Use the whole clip" : "Use this part";
    const last = Math.max(1, clip.frames[1] - 1), place = n => `calc(8px + (100% - 16px) * ${n / last})`;
    byId("chosen").style.left = `calc(${place(a)} - 8px)`;
    byId("chosen").style.right = `calc(100% - ${place(b)} - 8px)`;
  };

  const keep = () => {
    const [a, b] = range(), whole = a === 0 && b === clip.frames[1] - 1;
    studio.change({
      frames: whole ? null : [a, b + 1], stride: Number(byId("stride").value),
      downscale: Number(byId("downscale").value),
    });
    tell();
  };

  const stop = () => {
    clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
    play.setAttribute("aria-pressed", "false");
  };

  const thumbs = async () => {
    const dense = devicePixelRatio || 1, pen = strip.getContext("2d");
    strip.width = strip.clientWidth * dense;
    strip.height = 52 * dense;
    const width = strip.width / THUMBS;
    for (let k = 0; k < THUMBS; k++) {
      const image = await frame(Math.round((k + 0.5) / THUMBS * (clip.frames[1] - 1))).catch(() => null);
      if (!image) continue;
      const scale = Math.max(width / image.width, strip.height / image.height);
      const [w, h] = [width / scale, strip.height / scale];
      pen.drawImage(image, (image.width - w) / 2, (image.height - h) / 2, w, h, k * width, 0, width, strip.height);
    }
  };

  for (const [input, other] of [[start, end], [end, start]]) {
    input.addEventListener("input", () => {
      stop();
      if (input === start && Number(start.value) >= Number(end.value)) start.value = Number(end.value) - 1;
      if (input === end && Number(end.value) <= Number(start.value)) end.value = Number(start.value) + 1;
      other.style.zIndex = 1;
      input.style.zIndex = 2;
      show(Number(input.value));
      keep();
    });
  }
  for (const id of ["stride", "downscale"]) byId(id).addEventListener("change", keep);
  byId("rate").addEventListener("change", () => {
    const rate = number(byId("rate").value);
    studio.change({ rate: rate > 0 ? rate : null });
    stop();
    studio.run({ step: "preview" }).catch(studio.alarm);
  });
  play.addEventListener("click", () => {
    if (timer) return stop();
    play.textContent = "Pause";
    play.setAttribute("aria-pressed", "true");
    timer = setInterval(() => {
      const [a, b] = range();
      show(shown >= b || shown < a ? a : shown + 1);
    }, 1000 / Math.min(clip.fps, 60));
  });
  byId("trim-next").addEventListener("click", () => { stop(); studio.go("fabric"); });
  addEventListener("resize", () => { if (clip && studio.step === "trim") { thumbs(); show(shown); } });

  return {
    leave: stop,
    key(e) {
      if (e.key !== " " || !clip || ["BUTTON", "SELECT"].includes(document.activeElement.tagName)) return false;
      play.click();
      return true;
    },
    update({ work }, entered) {
      const reading = work.job?.running && work.job.step === "preview", found = work.clip && work.preview && !reading;
      if (document.activeElement !== byId("rate")) byId("rate").value = entered.rate ?? "";
      byId("trim-wait").hidden = Boolean(found);
      byId("trim-next").disabled = !found;
      if (!found) {
        clip = null;
        const ended = work.job?.step === "preview" && work.job.ended === "failed";
        byId("trim-wait").textContent = ended ? "The clip cannot be read." : "Reading the clip …";
        if (!work.job?.running && !ended && failed !== work.name) {
          studio.auto({ step: "preview" }).then(how => { if (how === "failed") failed = work.name; });
        }
        return;
      }
      if (clip && folder === work.preview && form === studio.shown) return;
      if (folder !== work.preview) images.clear();
      [clip, folder, form] = [work.clip, work.preview, studio.shown];
      const last = clip.frames[1] - 1;
      for (const input of [start, end]) input.max = last;
      [start.value, end.value] = entered.frames ? [entered.frames[0], entered.frames[1] - 1] : [0, last];
      byId("stride").value = entered.stride;
      byId("downscale").value = entered.downscale;
      tell();
      thumbs().then(() => show(Number(start.value)));
    },
  };
};
