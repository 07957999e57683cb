"use strict";
/**
 * Arrows of forces per mass on the fabric, all on one scale: their length is as the square root of the size, for sizes
 * differ by thousands.
 */
tessuto.Arrows = class {
  /** `data`: see `CauseData` in causes.rs; `size`: of the fabric [m]. */
  constructor(data, size) {
    this.sites = tessuto.numbers(Uint32Array, data.sites);
    // The arrow of 1 m/s²; gravity's is three times as long.
    this.unit = 0.045 * size;
    this.group = [];
    this.wanted = new Set();
    for (const { key, label, vectors } of data.forces) {
      const field = new tessuto.Motion(vectors, this.sites.length);
      const { mesh, position } = this.make();
      mesh.visible = false;
      this.group.push({ key, label, field, mesh, position });
    }
    this.paint(false);
  }

  /** Colours of the forces, by their place: those of their shares. */
  static colours(dark) {
    const all = tessuto.lineColours(dark);
    return all.slice(0, 4);
  }

  paint(dark) {
    const colours = tessuto.Arrows.colours(dark);
    this.group.forEach(({ mesh }, k) => mesh.material.color.set(colours[k]));
  }

  /** An empty mesh with room for an arrow at each site: a shaft of three sides and a head of four. */
  make() {
    const count = this.sites.length, index = [];
    for (let s = 0; s < count; s++) {
      const at = 11 * s;
      for (let k = 0; k < 3; k++) {
        const [a, b] = [at + k, at + (k + 1) % 3];
        index.push(a, b, b + 3, a, b + 3, a + 3);
      }
      for (let k = 0; k < 4; k++) index.push(at + 6 + k, at + 6 + (k + 1) % 4, at + 10);
      index.push(at + 6, at + 8, at + 7, at + 6, at + 9, at + 8);
    }
    const geometry = new THREE.BufferGeometry();
    const position = new THREE.BufferAttribute(new Float32Array(33 * count), 3);
    geometry.setAttribute("position", position);
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(index), 1));
    const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    mesh.frustumCulled = false;
    return { mesh, position };
  }

  /** Length [m] of the arrow of so many m/s². */
  length(size) {
    return this.unit * Math.sqrt(size);
  }

  get shown() {
    return this.wanted.size > 0;
  }

  toggle(key, on) {
    if (on) this.wanted.add(key);
    else this.wanted.delete(key);
  }

  /** Moves the arrows that are shown to frame `frame`, at `places` (y up), three numbers per vertex. */
  show(frame, places) {
    for (const { field, mesh, position } of this.group) {
      if (!mesh.visible) continue;
      const vectors = field.at(frame), out = position.array;
      for (let s = 0; s < this.sites.length; s++) {
        const from = [0, 1, 2].map(k => places[3 * this.sites[s] + k]);
        this.put(out, 33 * s, from, [vectors[3 * s], -vectors[3 * s + 1], -vectors[3 * s + 2]], field.precision);
      }
      position.needsUpdate = true;
    }
  }

  /** One arrow from `from` along `force` [m/s²]; what is below the precision of the numbers is a point. */
  put(out, at, from, force, precision) {
    const size = Math.hypot(...force);
    if (size < 4 * precision + 1e-3) {
      for (let k = 0; k < 33; k++) out[at + k] = from[k % 3];
      return;
    }
    const along = force.map(v => v / size), length = this.length(size);
    // Two directions across it.
    const least = along.map(Math.abs).indexOf(Math.min(...along.map(Math.abs)));
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let u = cross(along, [0, 1, 2].map(k => (k === least ? 1 : 0)));
    u = u.map(v => v / Math.hypot(...u));
    const w = cross(along, u), head = Math.min(0.4 * length, 0.3 * this.unit), thick = 0.11 * this.unit;
    let k = at;
    const point = (far, round, angle) => {
      const [c, s] = [Math.cos(angle) * round, Math.sin(angle) * round];
      for (let a = 0; a < 3; a++) out[k++] = from[a] + along[a] * far + u[a] * c + w[a] * s;
    };
    const turn = 2 * Math.PI;
    const slim = Math.min(thick, 0.12 * length);
    for (const far of [0, length - head]) for (let n = 0; n < 3; n++) point(far, slim / 2, n * turn / 3);
    for (let n = 0; n < 4; n++) point(length - head, Math.min(1.3 * thick, 0.25 * length), n * turn / 4);
    point(length, 0, 0);
  }
};
