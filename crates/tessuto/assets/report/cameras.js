"use strict";
/**
 * The cameras of the recording: a small pyramid where each stands in the frame that is shown, a line along the way of
 * one that moves, and the choice of the one whose video is shown and which is looked through.
 */
tessuto.Cameras = class {
  /** `elements`: choices, shown, layer, tag, through; `data`: what the page embeds; `page`: player, view, wipe. */
  constructor(elements, data, { player, view, wipe }) {
    Object.assign(this, { elements, player, view, wipe, chosen: 0 });
    const { cloth, film, others = [] } = data;
    const first = { name: "original", camera: cloth.camera, poses: cloth.poses, late: 0, film };
    this.all = [first, ...others].map(one => ({ ...one, ...this.make(one.poses) }));
    this.makeChoices();
    tessuto.darkness.addEventListener("change", () => this.paint());
    this.paint();
    if (!view) return;
    for (const { body, lines, way } of this.all) view.world.add(body, lines, ...(way ? [way] : []));
    view.overview = () => (elements.shown.checked ? this.surroundings() : null);
    elements.shown.addEventListener("change", () => {
      if (!view.throughLens) view.orbitView();
      this.place();
    });
    elements.through.addEventListener("change", () => this.place());
    const { canvas } = view.elements;
    let pressed = null;
    canvas.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", event => {
      const far = pressed ? Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) : Infinity;
      const k = far < 4 ? this.under(event) : -1;
      if (k >= 0) this.lookThrough(k);
    });
    canvas.addEventListener("pointermove", event => {
      const k = event.buttons ? -1 : this.under(event);
      canvas.style.cursor = k < 0 ? "" : "pointer";
      if (k >= 0) view.elements.probe.textContent = `camera ${this.all[k].name}: a click looks through it`;
    });
    player.listen(() => this.place());
    this.place();
    if (!view.turned && !view.throughLens && view.size) view.orbitView();
  }

  /** What is drawn of a camera: its pyramid as faces, which can be clicked at, and as lines; its way. */
  make(poses) {
    const attribute = count => new THREE.BufferAttribute(new Float32Array(3 * count), 3);
    const thing = (Kind, corners, index, material) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", corners);
      geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(index), 1));
      const made = new Kind(geometry, material);
      made.frustumCulled = false;
      return made;
    };
    // The eye, the four corners of the image and the tip of a mark above it.
    const corners = attribute(6);
    const faces = { side: THREE.DoubleSide, transparent: true, opacity: 0.16, depthWrite: false };
    const body = thing(THREE.Mesh, corners, [0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1, 1, 2, 5],
      new THREE.MeshBasicMaterial(faces));
    const edges = [0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1, 1, 5, 2, 5];
    const lines = thing(THREE.LineSegments, corners, edges, new THREE.LineBasicMaterial());
    let way = null;
    if (poses.length > 1) {
      const eyes = attribute(poses.length), index = [];
      poses.forEach((pose, n) => {
        eyes.array.set(tessuto.Cameras.eye(pose), 3 * n);
        if (n > 0) index.push(n - 1, n);
      });
      way = thing(THREE.LineSegments, eyes, index, new THREE.LineBasicMaterial());
    }
    return { corners, body, lines, way };
  }

  /** Where a camera with `pose` = [R t] by rows stands, y up; the origin without one. */
  static eye(pose) {
    return tessuto.Cameras.inWorld(pose, [0, 0, 0]);
  }

  /** A point of the camera's axes in the world, y up. */
  static inWorld(pose, point) {
    const moved = pose ? point.map((v, k) => v - pose[4 * k + 3]) : point;
    const [x, y, z] = pose ? [0, 1, 2].map(k => moved.reduce((sum, v, row) => sum + pose[4 * row + k] * v, 0)) : moved;
    return [x, -y, -z];
  }

  /** [R t] of camera `k` in frame `n`. */
  pose(k, n) {
    const { poses } = this.all[k];
    return poses.at(Math.min(n, poses.length - 1));
  }

  /** Length [m] of a pyramid: a part of the way from the cameras to the fabric, for all the same. */
  get length() {
    const { x, y, z } = this.view.centre;
    const ways = this.all.map((_, k) => {
      const eye = tessuto.Cameras.eye(this.pose(k, 0));
      return Math.hypot(x - eye[0], y - eye[1], z - eye[2]);
    });
    return 0.13 * Math.min(...ways);
  }

  /** Middle and radius of a ball around the fabric and all ways of the cameras, and from where it is looked at. */
  surroundings() {
    const { view } = this;
    const eyes = this.all.flatMap(({ poses }) => (poses.length ? poses : [undefined]).map(tessuto.Cameras.eye));
    const points = eyes.map(p => new THREE.Vector3(...p));
    const { centre: c, radius: r } = view;
    const ends = [-1, 1].flatMap(s => [[s * r, 0, 0], [0, s * r, 0], [0, 0, s * r]]);
    points.push(...ends.map(([x, y, z]) => new THREE.Vector3(c.x + x, c.y + y, c.z + z)));
    const low = points[0].clone(), high = points[0].clone();
    for (const p of points) {
      low.min(p);
      high.max(p);
    }
    const centre = low.add(high).multiplyScalar(0.5);
    const radius = 1.04 * Math.max(...points.map(p => p.distanceTo(centre)));
    return { centre, radius, left: -0.95, up: 0.4 };
  }

  /** Stands the pyramids where the cameras are; what is looked through is not seen. */
  place() {
    const { view, elements, player } = this;
    if (!view?.centre) return;
    const length = this.length;
    this.all.forEach(({ camera, corners, body, lines, way }, k) => {
      const own = k === this.chosen && view.throughLens;
      for (const part of [body, lines, way]) if (part) part.visible = elements.shown.checked && !own;
      const { fx, fy, cx, cy, width, height } = camera;
      const at = (column, row) => [(column - cx) / fx * length, (row - cy) / fy * length, length];
      const [left, right, top, bottom] = [-0.5, width - 0.5, -0.5, height - 0.5];
      const points = [[0, 0, 0], at(left, top), at(right, top), at(right, bottom), at(left, bottom),
        at(width / 2, -0.2 * height)];
      points.forEach((p, n) => corners.array.set(tessuto.Cameras.inWorld(this.pose(k, player.frame), p), 3 * n));
      corners.needsUpdate = true;
      body.geometry.boundingSphere = null;
    });
    view.draw();
  }

  paint() {
    const colours = tessuto.lineColours(tessuto.darkness.matches);
    this.all.forEach(({ body, lines, way }, k) => {
      for (const part of [body, lines, way]) part?.material.color.set(colours[k % colours.length]);
    });
    this.buttons?.forEach((button, k) => { button.firstChild.style.background = colours[k % colours.length]; });
    this.view?.draw();
  }

  /** The camera whose pyramid is under the pointer; −1 for none. */
  under(event) {
    const { view } = this, box = view.elements.canvas.getBoundingClientRect();
    const pointer = new THREE.Vector2((event.clientX - box.left) / box.width * 2 - 1,
      1 - (event.clientY - box.top) / box.height * 2);
    const caster = new THREE.Raycaster();
    caster.setFromCamera(pointer, view.camera);
    view.geometry.boundingSphere = null;
    const seen = this.all.filter(({ body }) => body.visible).map(({ body }) => body);
    const hit = caster.intersectObjects([...seen, view.mesh], false)[0];
    return this.all.findIndex(({ body }) => body === hit?.object);
  }

  /** One button a camera, where there are several. */
  makeChoices() {
    const { choices } = this.elements;
    if (!choices) return;
    this.buttons = this.all.map(({ name }, k) => {
      const button = document.createElement("button"), mark = document.createElement("i");
      button.type = "button";
      button.dataset.camera = k;
      button.append(mark, name);
      button.addEventListener("click", () => this.choose(k));
      return button;
    });
    choices.append(...this.buttons);
    this.mark();
  }

  mark() {
    this.buttons?.forEach((button, k) => button.setAttribute("aria-pressed", String(k === this.chosen)));
    const { tag } = this.elements;
    if (tag) tag.textContent = `video: ${this.all[this.chosen].name}`;
  }

  /** Shows the video of camera `k`; a view through a camera becomes that through it. */
  choose(k) {
    const { view, wipe } = this, { film, poses, camera, late } = this.all[k];
    this.chosen = k;
    this.mark();
    if (view) {
      view.poses = poses;
      view.lens = film.camera ?? camera;
      if (view.throughLens) view.cameraView();
      this.place();
    }
    if (!wipe || !film.layers.length) return;
    if (view) wipe.mesh = frame => this.threads(frame, poses, late);
    wipe.setFilm(film);
    const { layer } = this.elements, before = layer.value;
    layer.replaceChildren(...wipe.choices().map(([key, label]) => new Option(label, key)));
    if ([...layer.options].some(option => option.value === before)) layer.value = before;
    layer.dispatchEvent(new Event("change"));
  }

  /** Positions in the camera's axes when it takes frame `frame`, and the edges of the threads. */
  threads(frame, poses, late) {
    const { view } = this, motion = view.replay ?? view.motion;
    let positions = motion.at(frame);
    if (late && motion.frames > 1) {
      // Straight between two frames, and on beyond them.
      const n = Math.max(0, Math.min(Math.floor(frame + late), motion.frames - 2)), t = frame + late - n;
      const before = motion.at(n).slice(), after = motion.at(n + 1);
      positions = before.map((v, i) => v + t * (after[i] - v));
    }
    return {
      positions: tessuto.seenFrom(poses.at(Math.min(frame, poses.length - 1)), positions), edges: view.surface.edges,
    };
  }

  /** Looks through camera `k`, and shows its video. */
  lookThrough(k) {
    this.choose(k);
    this.view.elements.probe.textContent = "";
    this.elements.through.checked = true;
    this.view.cameraView();
    this.view.resize();
    this.place();
  }
};

(() => {
  const byId = id => document.getElementById(id), { page } = tessuto;
  const elements = {
    choices: byId("cameras"), shown: byId("show-cameras"), layer: byId("layer"), tag: byId("film-tag"),
    through: byId("through-camera"),
  };
  const cameras = page.cameras = new tessuto.Cameras(elements, page.data, page);
  const left = page.view?.onLeaveCamera;
  if (page.view) page.view.onLeaveCamera = () => {
    left?.();
    cameras.place();
  };
  addEventListener("keydown", event => {
    if (event.key.toLowerCase() !== "v" || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest?.("select, summary, #wipe, a") || cameras.all.length < 2) return;
    cameras.choose((cameras.chosen + 1) % cameras.all.length);
  });
})();
