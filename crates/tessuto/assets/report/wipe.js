"use strict";
/** The video, and right of a border that can be moved what is compared with it. */
tessuto.Wipe = class {
  /** `film`: see `Film` in film.rs; `mesh(frame)`: positions and edges of the threads, if there are any. */
  constructor(elements, film, mesh) {
    Object.assign(this, { elements, film, mesh, frame: 0, share: 0.5, images: {}, drawn: 0 });
    this.pen = elements.canvas.getContext("2d");
    this.scratch = document.createElement("canvas");
    new ResizeObserver(() => this.resize()).observe(elements.box);
    const move = event => {
      const box = elements.canvas.getBoundingClientRect();
      const { x, width } = this.place();
      this.setShare(((event.clientX - box.left) * this.density - x) / width);
      this.onShare?.(this.share);
    };
    elements.box.addEventListener("pointerdown", event => {
      elements.box.setPointerCapture(event.pointerId);
      move(event);
    });
    elements.box.addEventListener("pointermove", event => { if (event.buttons & 1) move(event); });
  }

  /** What the video can be compared with: [key, label]. */
  choices() {
    const has = key => this.film.layers.some(l => l.key === key);
    const drawn = this.film.layers.filter(l => l.key !== "observed").map(l => [l.key, l.label]);
    const best = has("rerendered") ? "rerendered" : "render";
    if (has("observed") && has(best)) drawn.push([`difference:${best}`, "colour difference, 4×"]);
    if (this.mesh && this.film.camera) drawn.push(["mesh", "threads on the video"]);
    return drawn;
  }

  /** Takes the images of another camera. */
  setFilm(film) {
    Object.assign(this, { film, images: {} });
    this.show(this.frame);
  }

  setLayer(key) {
    this.layer = key;
    this.draw();
  }

  setShare(share) {
    this.share = Math.max(0, Math.min(1, share));
    this.draw();
  }

  /** Shows frame `frame`; the last picture stays for what goes on after the video. */
  show(frame) {
    this.frame = Math.min(frame, Math.max(...this.film.layers.map(l => l.frames.length)) - 1);
    this.draw();
    // The next frames, so that playing does not wait.
    for (const layer of this.film.layers) {
      for (let k = 1; k <= 4; k++) this.image(layer.key, (frame + k) % layer.frames.length);
    }
  }

  /** The image of a layer at a frame; it draws itself once it is decoded. */
  image(key, frame) {
    const layer = this.film.layers.find(l => l.key === key);
    if (!layer?.frames[frame]) return null;
    const held = this.images[key] ??= [];
    if (!held[frame]) {
      const image = held[frame] = new Image();
      image.src = `data:image/jpeg;base64,${layer.frames[frame]}`;
      image.decode().then(() => {
        image.ready = true;
        if (frame === this.frame) this.draw();
      }, () => {});
    }
    return held[frame].ready ? held[frame] : null;
  }

  resize() {
    const { canvas, box } = this.elements;
    this.density = Math.min(devicePixelRatio, 2);
    canvas.width = Math.max(1, Math.round(box.clientWidth * this.density));
    canvas.height = Math.max(1, Math.round(box.clientHeight * this.density));
    this.drawNow();
  }

  /** Where the image lies on the canvas. */
  place() {
    const { canvas } = this.elements, { film } = this;
    const scale = Math.min(canvas.width / film.width, canvas.height / film.height);
    const [width, height] = [film.width * scale, film.height * scale];
    return { x: (canvas.width - width) / 2, y: (canvas.height - height) / 2, width, height, scale };
  }

  draw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    cancelAnimationFrame(this.pending);
    this.pending = 0;
    const { pen, frame } = this, { canvas, handle } = this.elements;
    const at = this.place();
    const border = at.x + at.width * this.share;
    const observed = this.image("observed", frame);
    const other = this.other(frame, observed);
    // What is not decoded yet leaves the last image standing: no flicker.
    if (!observed || other === undefined) return;
    pen.imageSmoothingQuality = "high";
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(observed, at.x, at.y, at.width, at.height);
    pen.save();
    pen.beginPath();
    pen.rect(border, 0, canvas.width - border, canvas.height);
    pen.clip();
    if (other) pen.drawImage(other, at.x, at.y, at.width, at.height);
    if (this.layer === "mesh") this.drawMesh(at);
    pen.restore();
    handle.style.left = `${border / this.density}px`;
    this.drawn++;
  }

  /** The image right of the border; null for none, undefined if it is not ready. */
  other(frame, observed) {
    if (!this.layer || this.layer === "mesh") return null;
    const [kind, key] = this.layer.split(":");
    const image = this.image(key ?? kind, frame);
    if (!image) return undefined;
    return kind === "difference" && observed ? this.difference(observed, image) : image;
  }

  /** |a − b|, four times as bright. */
  difference(a, b) {
    const { scratch, film } = this;
    [scratch.width, scratch.height] = [film.width, film.height];
    const pen = scratch.getContext("2d");
    pen.drawImage(a, 0, 0);
    pen.globalCompositeOperation = "difference";
    pen.drawImage(b, 0, 0);
    pen.globalCompositeOperation = "lighter";
    for (let k = 0; k < 2; k++) pen.drawImage(scratch, 0, 0);
    return scratch;
  }

  drawMesh(at) {
    const { pen } = this, { fx, fy, cx, cy } = this.film.camera;
    const { positions: p, edges } = this.mesh(this.frame);
    const u = new Float32Array(p.length / 3), v = new Float32Array(p.length / 3);
    for (let i = 0; i < u.length; i++) {
      u[i] = at.x + (fx * p[3 * i] / p[3 * i + 2] + cx + 0.5) * at.scale;
      v[i] = at.y + (fy * p[3 * i + 1] / p[3 * i + 2] + cy + 0.5) * at.scale;
    }
    pen.beginPath();
    for (let e = 0; e < edges.length; e += 2) {
      pen.moveTo(u[edges[e]], v[edges[e]]);
      pen.lineTo(u[edges[e + 1]], v[edges[e + 1]]);
    }
    pen.lineWidth = this.density * 0.7;
    pen.strokeStyle = "rgb(0 255 220 / 75%)";
    pen.stroke();
  }
};
