/** A frame of the scene with what is known of it: the mask's border, what is outside of it, the template, clicks. */
import { fileUrl, fitCanvas, loadImage } from "./api.js";

const KEPT = 24;

/** Vertices and edges of a template. */
export const loadMesh = async url => {
  const text = await (await fetch(url)).text(), vertices = [], edges = new Set();
  for (const line of text.split("\n")) {
    const [kind, ...words] = line.trim().split(/\s+/);
    if (kind === "v") vertices.push(words.slice(0, 3).map(Number));
    if (kind === "f") {
      const face = words.map(w => Number.parseInt(w, 10) - 1);
      face.forEach((a, k) => { const b = face[(k + 1) % face.length]; edges.add(a < b ? `${a} ${b}` : `${b} ${a}`); });
    }
  }
  return { vertices, edges: [...edges].map(e => e.split(" ").map(Number)) };
};

/** The mask as an image that darkens what is outside and marks the border. */
const shade = mask => {
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: mask.naturalWidth, height: mask.naturalHeight });
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.drawImage(mask, 0, 0);
  const image = pen.getImageData(0, 0, canvas.width, canvas.height), { data, width, height } = image;
  const is = new Uint8Array(width * height);
  for (let k = 0; k < is.length; k++) is[k] = data[4 * k] > 127;
  const thick = Math.max(1, Math.round(Math.max(width, height) / 900));
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const k = y * width + x, here = is[k];
      const border = here && (x < thick || y < thick || x >= width - thick || y >= height - thick
        || !is[k - thick] || !is[k + thick] || !is[k - thick * width] || !is[k + thick * width]);
      data.set(border ? [255, 210, 63, 255] : here ? [0, 0, 0, 0] : [8, 12, 18, 150], 4 * k);
    }
  }
  pen.putImageData(image, 0, 0);
  return canvas;
};

export const overlay = canvas => {
  const pen = canvas.getContext("2d"), kept = new Map();
  let names = { frames: [], masks: [] }, version = "", wanted = 0, scale = 1, now = null;

  const load = n => {
    const key = `${version} ${n}`;
    if (!kept.has(key)) {
      if (kept.size >= KEPT) kept.delete(kept.keys().next().value);
      const mask = names.masks[n] ? loadImage(fileUrl(names.masks[n], version)).then(shade).catch(() => null) : null;
      kept.set(key, Promise.all([loadImage(fileUrl(names.frames[n], version)), mask]));
    }
    return kept.get(key);
  };

  const marks = (clicks, dense) => {
    for (const c of clicks) {
      const [x, y] = [(c.x + 0.5) * scale, (c.y + 0.5) * scale], r = 9 * dense;
      pen.beginPath();
      pen.arc(x, y, r, 0, 7);
      pen.fillStyle = c.inside ? "#1fa060" : "#d02f52";
      pen.fill();
      pen.strokeStyle = "#fff";
      pen.lineWidth = 2 * dense;
      pen.stroke();
      pen.beginPath();
      pen.moveTo(x - r / 2, y);
      pen.lineTo(x + r / 2, y);
      if (c.inside) { pen.moveTo(x, y - r / 2); pen.lineTo(x, y + r / 2); }
      pen.stroke();
    }
  };

  const draw = async ({ frame, mask, mesh, camera, clicks }) => {
    const mine = ++wanted;
    if (!names.frames[frame]) return;
    const [image, shaded] = await load(frame);
    if (mine !== wanted) return;
    now = frame;
    const dense = devicePixelRatio || 1;
    scale = fitCanvas(canvas, image.naturalWidth, image.naturalHeight);
    pen.drawImage(image, 0, 0, canvas.width, canvas.height);
    if (mask && shaded) pen.drawImage(shaded, 0, 0, canvas.width, canvas.height);
    if (mesh && camera) {
      const at = mesh.vertices.map(([x, y, z]) =>
        [(camera.fx * x / z + camera.cx + 0.5) * scale, (camera.fy * y / z + camera.cy + 0.5) * scale]);
      pen.beginPath();
      for (const [a, b] of mesh.edges) { pen.moveTo(...at[a]); pen.lineTo(...at[b]); }
      pen.strokeStyle = "rgb(40 205 235 / 75%)";
      pen.lineWidth = dense;
      pen.stroke();
    }
    marks(clicks.filter(c => c.frame === frame), dense);
  };

  return {
    draw,
    /** Other files, or the same ones anew. */
    set(files, at) { [names, version] = [files, at]; kept.clear(); now = null; },
    get count() { return names.frames.length; },
    get shown() { return now; },
    toImage(e) {
      const box = canvas.getBoundingClientRect(), unit = canvas.width / box.width / scale;
      return { x: Math.round((e.clientX - box.left) * unit - 0.5), y: Math.round((e.clientY - box.top) * unit - 0.5) };
    },
  };
};
