"use strict";
/**
 * The moving fabric in 3D. y is up here: (x, −y, −z) of the recording camera's axes in the first frame of the video,
 * in which that camera is at the origin.
 */
tessuto.ClothView = class {
  /** `elements`: canvas, box, legend…; `data`: what the page embeds about the fabric; `images`: maps by key. */
  constructor(elements, data, light, images) {
    this.elements = elements;
    this.data = data;
    this.images = images;
    this.lightData = light;
    this.surface = new tessuto.Surface(data.surface);
    this.poses = data.poses;
    this.frame = 0;
    this.renderer = new THREE.WebGLRenderer({ canvas: elements.canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.toneMapping = THREE.NoToneMapping;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.01, 100);
    this.scene.add(this.camera);
    // All of the fabric; through a recording camera that moves it stands where that camera sees it.
    this.world = new THREE.Scene();
    this.world.matrixAutoUpdate = false;
    this.scene.add(this.world);
    this.lights = [new THREE.AmbientLight(0xffffff), new THREE.DirectionalLight(0xffffff)];
    this.lights[1].position.set(-0.6, 0.7, 1);
    this.scene.add(this.lights[0]);
    this.camera.add(this.lights[1], this.lights[1].target);
    this.lights[1].target.position.set(0, 0, -1);
    this.controls = new THREE.OrbitControls(this.camera, elements.canvas);
    this.controls.enableDamping = true;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => {
      this.turned = true;
      this.leaveCamera();
    });
    this.build();
    this.setMotion(data.motion);
    new ResizeObserver(() => this.resize()).observe(elements.box);
    elements.canvas.addEventListener("pointermove", event => this.probe(event));
    elements.canvas.addEventListener("pointerleave", () => { elements.probe.textContent = ""; });
  }

  build() {
    const { corners, uvs, triangles, edges } = this.surface;
    const geometry = this.geometry = new THREE.BufferGeometry();
    const attribute = size => new THREE.BufferAttribute(new Float32Array(corners.length * size), size);
    geometry.setAttribute("position", attribute(3));
    geometry.setAttribute("normal", attribute(3));
    geometry.setAttribute("color", attribute(3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(uvs, 2));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.materials = this.makeMaterials();
    this.mesh = new THREE.Mesh(geometry, this.materials.plain);
    this.mesh.frustumCulled = false;
    const lines = new THREE.BufferGeometry();
    this.linePositions = new THREE.BufferAttribute(new Float32Array(3 * this.surface.vertexCount), 3);
    lines.setAttribute("position", this.linePositions);
    lines.setIndex(new THREE.BufferAttribute(edges, 1));
    this.lines = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ transparent: true, opacity: 0.5 }));
    this.lines.frustumCulled = false;
    this.lines.visible = false;
    this.world.add(this.mesh, this.lines);
    // The threads as found, beside a changed replay.
    const found = new THREE.BufferGeometry();
    this.foundPositions = new THREE.BufferAttribute(new Float32Array(3 * this.surface.vertexCount), 3);
    found.setAttribute("position", this.foundPositions);
    found.setIndex(new THREE.BufferAttribute(edges, 1));
    this.foundLines = new THREE.LineSegments(found, this.lines.material);
    this.foundLines.frustumCulled = false;
    this.foundLines.visible = false;
    this.world.add(this.foundLines);
  }

  /** Takes the forces of `data`, see `CauseData` in causes.rs; none is shown yet. */
  makeArrows(data) {
    this.arrows = new tessuto.Arrows(data, this.radius);
    this.world.add(...this.arrows.group.map(({ mesh }) => mesh));
    return this.arrows;
  }

  /** Pixels on the screen of a length [m] at the middle of the fabric, across the view. */
  pixels(length) {
    const distance = this.camera.position.distanceTo(this.centre), lens = 2 * Math.tan(this.camera.fov * Math.PI / 360);
    const zoom = this.camera.view?.enabled ? this.camera.view.fullHeight / this.camera.view.height : 1;
    return length * zoom * (this.size?.height ?? 0) / (lens * distance);
  }

  /** Shows a changed replay, see `EmbeddedMotion` in embed.rs, in place of what was found; null: what was found. */
  setReplay(raw) {
    this.replay = raw && new tessuto.Motion(raw, this.surface.vertexCount);
    if (raw) this.fields = this.valuesOf([], this.replay);
    else this.setMotion(this.data.motion);
  }

  makeMaterials() {
    // Threads are drawn over the surface, not into it.
    const offset = this.offset = {
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    };
    const materials = {
      plain: new THREE.MeshLambertMaterial({ ...offset, color: 0xb9bec6 }),
      value: new THREE.MeshLambertMaterial({ ...offset, vertexColors: true }),
    };
    for (const key of Object.keys(this.images)) {
      const map = this.texture(key, THREE.SRGBColorSpace);
      const Kind = key === "texture" ? THREE.MeshLambertMaterial : THREE.MeshBasicMaterial;
      materials[key] = this.twoSided(new Kind({ ...offset, map }), this.data.back?.[key]);
    }
    return materials;
  }

  /** The `material` with a `colour` on the fabric's other side, which is matt, where that has one. */
  twoSided(material, colour) {
    if (!colour) return material;
    const value = new THREE.Color(colour), turned = this.data.back.outward ? "!gl_FrontFacing" : "gl_FrontFacing";
    const after = {
      map: "diffuseColor.rgb = back", roughnessmap: "roughnessFactor = 1.0", metalnessmap: "metalnessFactor = 0.0",
    };
    material.onBeforeCompile = shader => {
      shader.uniforms.back = { value };
      shader.fragmentShader = "uniform vec3 back;\n" + shader.fragmentShader;
      for (const [part, set] of Object.entries(after)) {
        const place = `#include <${part}_fragment>`;
        shader.fragmentShader = shader.fragmentShader.replace(place, `${place}\nif (${turned}) ${set};`);
      }
    };
    return material;
  }

  /** Wears the image of the first frame where `lens` sees each vertex in it: before a print is recovered. */
  wear(image, lens) {
    const p = this.motion.at(0), { corners, uvs } = this.surface;
    corners.forEach((v, c) => {
      const z = p[3 * v + 2];
      uvs[2 * c] = (lens.fx * p[3 * v] / z + lens.cx + 0.5) / lens.width;
      uvs[2 * c + 1] = 1 - (lens.fy * p[3 * v + 1] / z + lens.cy + 0.5) / lens.height;
    });
    this.geometry.getAttribute("uv").needsUpdate = true;
    this.images.texture = image;
    const map = this.texture("texture", THREE.SRGBColorSpace);
    this.materials.texture = new THREE.MeshLambertMaterial({ ...this.offset, map });
  }

  texture(key, space) {
    const image = this.images[key], map = new THREE.Texture(image);
    map.colorSpace = space;
    map.anisotropy = this.renderer.capabilities.getMaxAnisotropy();
    // Texture coordinates beyond 0…1 mean repetition; then the maps are whole.
    map.wrapS = map.wrapT = THREE.RepeatWrapping;
    const ready = () => {
      map.needsUpdate = true;
      this.draw();
    };
    if (image.complete && image.naturalWidth > 0) ready();
    else image.addEventListener("load", ready, { once: true });
    return map;
  }

  /** Whether material and light were recovered. */
  get canBeLit() {
    return Boolean(this.images.diffuse && this.images.roughness && this.images.metallic && this.lightData);
  }

  /** The recovered material in the chosen light; made when first wanted, filtering the light takes a while. */
  litMaterial() {
    this.environment ??= this.makeEnvironment();
    this.materials.lit ??= this.twoSided(new THREE.MeshStandardMaterial({
      ...this.offset,
      map: this.materials.diffuse.map,
      roughnessMap: this.texture("roughness", THREE.NoColorSpace),
      metalnessMap: this.texture("metallic", THREE.NoColorSpace),
      roughness: 1,
      metalness: 1,
      envMap: this.environment.filtered,
    }), this.data.back?.diffuse);
    return this.materials.lit;
  }

  /** Lights that can be chosen: [key, label]. */
  lightChoices() {
    const made = Object.entries(tessuto.madeLights).map(([key, { label }]) => [key, label]);
    return [["recovered", "recovered light"], ...made];
  }

  /** Chooses the light of the lit look. */
  setLight(key) {
    this.lightKey = key;
    this.environment?.target.dispose();
    this.environment?.image.dispose();
    this.environment = this.makeEnvironment();
    if (this.materials.lit) this.materials.lit.envMap = this.environment.filtered;
    this.setBackground(this.background);
  }

  /** Turns the light about the vertical by so many degrees. */
  turnLight(degrees) {
    const angle = degrees * Math.PI / 180;
    this.litMaterial().envMapRotation.y = this.scene.backgroundRotation.y = angle;
    this.draw();
  }

  /** The chosen light: as an image for the background, and filtered for the material. */
  makeEnvironment() {
    const made = tessuto.madeLights[this.lightKey];
    const { width, height } = made ? { width: 128, height: 64 } : this.lightData;
    const radiance = made ? tessuto.radianceOf(made, width, height)
      : tessuto.numbers(Float32Array, this.lightData.radiance);
    const texels = new Float32Array(4 * width * height);
    for (let row = 0; row < height; row++) {
      for (let column = 0; column < width; column++) {
        // Ours has the camera's view in its middle and up in row 0; three.js has −x there, and down in row 0.
        const to = 4 * ((height - 1 - row) * width + (column + width - Math.floor(width / 4)) % width);
        const from = 3 * (row * width + column);
        texels.set(radiance.subarray(from, from + 3), to);
        texels[to + 3] = 1;
      }
    }
    const image = new THREE.DataTexture(texels, width, height, THREE.RGBAFormat, THREE.FloatType);
    image.mapping = THREE.EquirectangularReflectionMapping;
    image.minFilter = image.magFilter = THREE.LinearFilter;
    image.wrapS = THREE.RepeatWrapping;
    image.needsUpdate = true;
    const generator = new THREE.PMREMGenerator(this.renderer);
    const target = generator.fromEquirectangular(image);
    generator.dispose();
    return { image, target, filtered: target.texture };
  }

  /** Takes another motion, such as that of a later step. */
  setMotion(raw) {
    const first = !this.motion;
    this.motion = new tessuto.Motion(raw, this.surface.vertexCount);
    this.fields = this.valuesOf(this.data.fields, this.motion);
    const { centre: [x, y, z], radius } = this.motion.extent();
    this.centre = new THREE.Vector3(x, -y, -z);
    this.radius = radius;
    if (first && this.motion.frames > 0) this.orbitView();
    if (!this.motion.frames) this.motion = null;
    if (this.motion) this.show(this.frame);
  }

  /** What the fabric can be coloured by: `raw` values, and the strain of `motion`. */
  valuesOf(raw, motion) {
    const fields = raw.map(f => new tessuto.Field(f, this.surface.vertexCount));
    if (motion.frames > 0) fields.push(new tessuto.Strain(this.surface, motion));
    return Object.fromEntries(fields.map(f => [f.key, f]));
  }

  /** What the fabric can look like: groups of [key, label]. */
  looks() {
    const of = pairs => pairs.filter(([key]) => key in this.materials || (key === "lit" && this.canBeLit));
    const values = Object.values(this.fields).map(f => [f.key, `${f.label} [${f.unit}]`]);
    return [
      ["Look", of([["lit", "recovered material and light"], ["texture", "recovered texture"], ["plain", "plain"]])],
      ["Map", of([["diffuse", "albedo"], ["roughness", "roughness"], ["metallic", "metallic"]])],
      ["Value", values],
    ].filter(([, members]) => members.length > 0);
  }

  setLook(key) {
    this.look = key;
    this.field = this.fields[key];
    const { value, plain } = this.materials;
    this.mesh.material = this.field ? value : key === "lit" ? this.litMaterial() : this.materials[key] ?? plain;
    for (const light of this.lights) light.visible = key !== "lit";
    // π: a white matt surface that faces the light is white. Relief counts where there is nothing else to see.
    const [around, ahead] = this.mesh.material === plain ? [0.3, 0.78] : [0.62, 0.42];
    this.lights[0].intensity = around * Math.PI;
    this.lights[1].intensity = ahead * Math.PI;
    const { legend } = this.elements;
    legend.root.hidden = !this.field;
    if (this.field) {
      const { label, unit, range: [low, high], diverging } = this.field;
      const number = v => (diverging && v > 0 ? "+" : "") + tessuto.readable(v).replace("-", "−");
      legend.title.textContent = label;
      legend.low.textContent = number(low);
      legend.middle.textContent = number((low + high) / 2);
      legend.high.textContent = `${number(high)} ${unit}`;
      this.paintLegend(tessuto.scales[diverging ? "diverging" : "sequential"]);
    }
    this.setBackground(this.background);
    if (this.motion) this.show(this.frame);
  }

  paintLegend(scale) {
    const bar = this.elements.legend.bar, pen = bar.getContext("2d");
    for (let x = 0; x < bar.width; x++) {
      pen.fillStyle = `rgb(${tessuto.colourAt(scale, x / (bar.width - 1)).join(" ")})`;
      pen.fillRect(x, 0, 1, 1);
    }
  }

  setBackground(on) {
    this.background = on;
    this.scene.background = on && this.look === "lit" ? this.environment.image : null;
    this.draw();
  }

  setWireframe(on) {
    this.lines.visible = on;
    this.draw();
  }

  setDark(dark) {
    this.lines.material.color.set(dark ? 0xffffff : 0x101418);
    this.draw();
  }

  /** Shows frame `frame`. */
  show(frame) {
    this.frame = frame;
    this.follow();
    if (!this.motion) return;
    const shown = this.place(this.linePositions, (this.replay ?? this.motion).at(frame));
    this.foundLines.visible = Boolean(this.replay) && frame < this.motion.frames;
    if (this.foundLines.visible) this.place(this.foundPositions, this.motion.at(frame));
    for (const { key, mesh } of this.arrows?.group ?? []) mesh.visible = !this.replay && this.arrows.wanted.has(key);
    if (!this.replay) this.arrows?.show(frame, shown);
    this.spread("position", shown);
    this.spread("normal", this.normals(shown));
    if (this.field) this.paint(frame);
    this.draw();
  }

  /** [R t] by rows of the camera that is looked through, in frame `n` or the last one before; none at the origin. */
  poseAt(n) {
    return this.poses.at(Math.min(n, this.poses.length - 1));
  }

  /** Stands the fabric where the recording camera sees it in this frame, in the view through that camera. */
  follow() {
    const pose = this.throughLens ? this.poseAt(this.frame) : undefined;
    // Of 3×4 numbers by rows: y and z of either frame are turned around.
    const turn = (value, k) => k > 3 !== (k % 4 === 1 || k % 4 === 2) ? -value : value;
    if (pose) this.world.matrix.set(...pose.map(turn), 0, 0, 0, 1);
    else this.world.matrix.identity();
    this.world.matrixWorldNeedsUpdate = true;
  }

  /** Positions into an attribute, y up. */
  place(attribute, p) {
    const out = attribute.array;
    for (let i = 0; i < p.length; i += 3) {
      out[i] = p[i];
      out[i + 1] = -p[i + 1];
      out[i + 2] = -p[i + 2];
    }
    attribute.needsUpdate = true;
    return out;
  }

  /** Copies a value per vertex to its corners. */
  spread(name, values) {
    const attribute = this.geometry.getAttribute(name), { corners } = this.surface;
    for (let c = 0; c < corners.length; c++) {
      for (let k = 0; k < 3; k++) attribute.array[3 * c + k] = values[3 * corners[c] + k];
    }
    attribute.needsUpdate = true;
  }

  /** Means of the triangles' normals, weighted by area; not normalised, the shader does that. */
  normals(p) {
    const { corners, triangles } = this.surface;
    const out = this.normalSums ??= new Float32Array(p.length);
    out.fill(0);
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map(k => 3 * corners[triangles[t + k]]);
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
      const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      for (const v of [a, b, c]) {
        out[v] += nx;
        out[v + 1] += ny;
        out[v + 2] += nz;
      }
    }
    // Sums of square metres are tiny; the shader's division wants numbers near 1.
    let largest = 0;
    for (const v of out) largest = Math.max(largest, Math.abs(v));
    if (largest > 0) for (let i = 0; i < out.length; i++) out[i] /= largest;
    return out;
  }

  paint(frame) {
    const { range: [low, high], diverging } = this.field;
    const scale = tessuto.scales[diverging ? "diverging" : "sequential"];
    const values = this.shownValues = this.field.at(frame);
    const colour = new THREE.Color(), colours = new Float32Array(3 * values.length);
    for (let v = 0; v < values.length; v++) {
      const rgb = isNaN(values[v]) ? tessuto.scales.none : tessuto.colourAt(scale, (values[v] - low) / (high - low));
      colour.setRGB(rgb[0] / 255, rgb[1] / 255, rgb[2] / 255, THREE.SRGBColorSpace).toArray(colours, 3 * v);
    }
    this.spread("color", colours);
  }

  /** Tells the value under the pointer. */
  probe(event) {
    const { canvas, probe } = this.elements;
    if (!this.motion || event.buttons !== 0) return;
    const box = canvas.getBoundingClientRect();
    const pointer = new THREE.Vector2((event.clientX - box.left) / box.width * 2 - 1,
      1 - (event.clientY - box.top) / box.height * 2);
    const caster = new THREE.Raycaster();
    caster.setFromCamera(pointer, this.camera);
    this.geometry.boundingSphere = null;
    const hit = caster.intersectObject(this.mesh, false)[0];
    if (!hit) {
      probe.textContent = "";
      return;
    }
    const corner = [hit.face.a, hit.face.b, hit.face.c];
    const p = this.geometry.getAttribute("position").array;
    const at = this.world.worldToLocal(hit.point.clone());
    const distance = c => at.distanceTo(new THREE.Vector3().fromArray(p, 3 * c));
    const vertex = this.surface.corners[corner.sort((a, b) => distance(a) - distance(b))[0]];
    const value = this.field
      ? isNaN(this.shownValues[vertex]) ? " · not measured here"
        : ` · ${tessuto.readable(this.shownValues[vertex])} ${this.field.unit}`
      : ` · ${tessuto.readable(-hit.point.z)} m from the camera`;
    probe.textContent = `vertex ${vertex}${value}`;
  }

  /** From the left and above, so that the relief is seen. */
  orbitView() {
    this.inCamera = this.throughLens = false;
    this.follow();
    this.camera.clearViewOffset();
    this.camera.fov = 32;
    // The narrower side of the view decides.
    const aspect = this.size ? this.size.width / this.size.height : 1;
    const half = Math.tan(this.camera.fov * Math.PI / 360) * Math.min(1, aspect);
    const { centre, radius, left, up } = this.overview?.() ??
      { centre: this.centre, radius: this.radius, left: -0.5, up: 0.25 };
    const distance = radius / Math.sin(Math.atan(half)) * 0.92;
    this.turned = false;
    const to = new THREE.Vector3(Math.sin(left) * Math.cos(up), Math.sin(up), Math.cos(left) * Math.cos(up));
    this.camera.position.copy(centre).addScaledVector(to, distance);
    this.aim(centre);
  }

  /** Through the recording camera. */
  cameraView() {
    this.inCamera = this.throughLens = true;
    this.follow();
    this.camera.position.set(0, 0, 0);
    this.aim(new THREE.Vector3(0, 0, this.centre.clone().applyMatrix4(this.world.matrix).z));
    this.fitLens();
  }

  aim(at) {
    this.camera.near = this.radius / 50;
    this.camera.far = this.radius * 100;
    this.controls.target.copy(at);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  /** The recording camera's field of view, or that of the film's part of it, in the middle of the view. */
  fitLens() {
    const lens = this.lens ?? this.data.camera;
    const { width, height } = this.size;
    if (!lens) return;
    const scale = Math.min(width / lens.width, height / lens.height);
    // An image whose middle is the principal point, of which the view shows the lens's part.
    const full = {
      width: 2 * Math.max(lens.cx + 0.5, lens.width - lens.cx - 0.5),
      height: 2 * Math.max(lens.cy + 0.5, lens.height - lens.cy - 0.5),
    };
    this.camera.fov = 2 * Math.atan(full.height / 2 / lens.fy) * 180 / Math.PI;
    const left = full.width / 2 - lens.cx - 0.5, top = full.height / 2 - lens.cy - 0.5;
    const marginX = (width / scale - lens.width) / 2, marginY = (height / scale - lens.height) / 2;
    this.camera.setViewOffset(full.width, full.height, left - marginX, top - marginY, width / scale, height / scale);
    this.camera.aspect = full.width / lens.fx / (full.height / lens.fy);
    this.camera.updateProjectionMatrix();
  }

  leaveCamera() {
    if (!this.inCamera) return;
    this.inCamera = false;
    this.onLeaveCamera?.();
  }

  toggleCamera() {
    if (this.inCamera) this.orbitView();
    else this.cameraView();
    this.resize();
    return this.inCamera;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.elements.box;
    if (!width || !height) return;
    this.size = { width, height };
    this.renderer.setSize(width, height, false);
    if (this.throughLens) this.fitLens();
    else {
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      if (!this.turned && this.motion) this.orbitView();
    }
    this.drawNow();
  }

  draw() {
    if (this.pending || !this.size) return;
    this.pending = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    cancelAnimationFrame(this.pending);
    this.pending = 0;
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
    this.drawn = (this.drawn ?? 0) + 1;
  }
};

/**
 * Lights to try the material in: radiance of the room and of lamps, which fill the directions within `cosine` of `at`
 * (x right, y down, z away from the camera).
 */
tessuto.madeLights = {
  lamps: {
    label: "a warm and a cold lamp",
    room: [0.25, 0.25, 0.25],
    lamps: [
      { at: [-0.7, -0.6, -0.5], cosine: 0.93, radiance: [7, 6, 4.5] },
      { at: [0.9, 0.1, -0.3], cosine: 0.9, radiance: [1.5, 2, 3] },
    ],
  },
  sky: {
    label: "open sky",
    room: [0.15, 0.14, 0.12],
    lamps: [
      { at: [0.4, -0.8, -0.5], cosine: 0.99, radiance: [60, 56, 48] },
      { at: [0, -1, 0], cosine: 0, radiance: [0.5, 0.65, 0.9] },
    ],
  },
  window: {
    label: "a window",
    room: [0.08, 0.08, 0.08],
    lamps: [{ at: [-1, -0.2, -0.7], cosine: 0.88, radiance: [6, 6.2, 6.5] }],
  },
};

/**
 * Radiance of a made light, 3 numbers per texel; the middle is where the camera looks. Of lamps that overlap the first
 * counts.
 */
tessuto.radianceOf = ({ room, lamps }, width, height) => {
  const out = new Float32Array(3 * width * height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const lon = ((column + 0.5) / width - 0.5) * 2 * Math.PI, lat = (0.5 - (row + 0.5) / height) * Math.PI;
      const to = [Math.cos(lat) * Math.sin(lon), -Math.sin(lat), Math.cos(lat) * Math.cos(lon)];
      const lit = lamps.find(({ at, cosine }) =>
        at.reduce((sum, v, k) => sum + v * to[k], 0) > cosine * Math.hypot(...at));
      out.set(lit?.radiance ?? room, 3 * (row * width + column));
    }
  }
  return out;
};
