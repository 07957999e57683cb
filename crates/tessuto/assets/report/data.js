"use strict";
/**
 * Everything of the page hangs on this name. Positions are in the recording camera's axes in the first frame (x right,
 * y down, z forward, metres) until `cloth.js` turns y up.
 */
const tessuto = {};

/** Bytes of a base64 text. */
tessuto.bytes = text => {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
};

/** A typed array of little-endian numbers, such as `numbers(Float32Array, text)`. */
tessuto.numbers = (Type, text) => new Type(tessuto.bytes(text).slice().buffer);

/** Positions in the frame of a camera with `pose` = [R t] by rows; as they are without one. */
tessuto.seenFrom = (pose, p) => {
  if (!pose) return p;
  const out = new Float32Array(p.length);
  for (let i = 0; i < p.length; i += 3)
    for (let k = 0; k < 3; k++)
      out[i + k] = pose[4 * k] * p[i] + pose[4 * k + 1] * p[i + 1] + pose[4 * k + 2] * p[i + 2] + pose[4 * k + 3];
  return out;
};

/** Topology and texture coordinates, see `Surface` in embed.rs. */
tessuto.Surface = class {
  constructor(raw) {
    this.vertexCount = raw.vertices;
    this.corners = tessuto.numbers(Uint32Array, raw.corners);
    this.uvs = tessuto.numbers(Float32Array, raw.uvs);
    this.triangles = tessuto.numbers(Uint32Array, raw.triangles);
    this.edges = tessuto.numbers(Uint32Array, raw.edges);
    this.lengths = tessuto.numbers(Float32Array, raw.lengths);
  }
};

/** Positions of all frames, see `Motion` in embed.rs. */
tessuto.Motion = class {
  constructor(raw, vertexCount) {
    this.frames = raw.frames;
    this.precision = raw.precision;
    this.vertexCount = vertexCount;
    this.boxes = tessuto.numbers(Float32Array, raw.boxes);
    this.steps = tessuto.numbers(Uint16Array, raw.steps);
    this.position = new Float32Array(3 * vertexCount);
  }

  /** Positions [m] of frame `n` (of the last one there is), Float32Array [V·3]; overwritten by the next call. */
  at(n) {
    n = Math.max(0, Math.min(n, this.frames - 1));
    const { position, boxes, steps, vertexCount } = this;
    const low = boxes.subarray(6 * n, 6 * n + 3), extent = boxes.subarray(6 * n + 3, 6 * n + 6);
    for (let i = 0, k = 3 * vertexCount * n; i < 3 * vertexCount; i++, k++) {
      position[i] = low[i % 3] + extent[i % 3] * steps[k] / 65535;
    }
    return position;
  }

  /** Middle of frame `n` and radius of a ball around all frames [m]. */
  extent(n = 0) {
    const middle = k => [0, 1, 2].map(a => this.boxes[6 * k + a] + this.boxes[6 * k + 3 + a] / 2);
    const centre = middle(n);
    let radius = 0;
    for (let k = 0; k < this.frames; k++) {
      const half = Math.hypot(...this.boxes.subarray(6 * k + 3, 6 * k + 6)) / 2;
      const m = middle(k);
      radius = Math.max(radius, half + Math.hypot(...m.map((v, a) => v - centre[a])) / 2);
    }
    return { centre, radius: radius || 1 };
  }
};

/** A number per vertex and frame, see `Field` in embed.rs. */
tessuto.Field = class {
  constructor(raw, vertexCount) {
    Object.assign(this, raw);
    this.vertexCount = vertexCount;
    this.data = tessuto.bytes(raw.steps);
  }

  /** Its values at frame `n` in its unit, NaN where there is none. */
  at(n) {
    const last = this.data.length / this.vertexCount - 1;
    const start = Math.min(n, last) * this.vertexCount;
    const [low, high] = this.range;
    return Float32Array.from(this.data.subarray(start, start + this.vertexCount),
      s => s === 0 ? NaN : low + (high - low) * (s - 1) / 254);
  }
};

/** Mean strain [%] of the threads at every vertex, against the template; made from the motion alone. */
tessuto.Strain = class {
  constructor(surface, motion) {
    Object.assign(this, { key: "strain", label: "strain of the threads", unit: "%", diverging: true });
    this.surface = surface;
    this.motion = motion;
    this.count = new Float32Array(surface.vertexCount);
    for (const v of surface.edges) this.count[v]++;
    const magnitudes = [];
    for (let n = 0; n < motion.frames; n += Math.ceil(motion.frames / 10)) {
      for (const v of this.at(n)) if (isFinite(v)) magnitudes.push(Math.abs(v));
    }
    magnitudes.sort((a, b) => a - b);
    const high = tessuto.roundedUp(Math.max(magnitudes[Math.floor(magnitudes.length * 0.98)] || 1, 0.1));
    this.range = [-high, high];
  }

  at(n) {
    const { edges, lengths, vertexCount } = this.surface;
    const p = this.motion.at(n), out = new Float32Array(vertexCount);
    for (let e = 0; e < lengths.length; e++) {
      const a = 3 * edges[2 * e], b = 3 * edges[2 * e + 1];
      const length = Math.hypot(p[a] - p[b], p[a + 1] - p[b + 1], p[a + 2] - p[b + 2]);
      const strain = 100 * (length / lengths[e] - 1);
      out[a / 3] += strain;
      out[b / 3] += strain;
    }
    return out.map((v, i) => v / this.count[i]);
  }
};

/** The next of 1, 2, 5, 10, 20 … times powers of ten. */
tessuto.roundedUp = value => {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map(s => s * power).find(s => s >= value * 0.999);
};

/** Height of a chart without its title and key [px]. */
tessuto.chartHeight = 210;

/** A value of a chart with its unit; what is nothing beside the largest is 0. */
tessuto.told = (value, chart) => {
  if (value === null || value === undefined) return "–";
  chart.largest ??= Math.max(...chart.series.flatMap(s => s.values.map(v => Math.abs(v ?? 0))));
  const shown = !chart.log && Math.abs(value) < 1e-3 * chart.largest ? 0 : value;
  return chart.unit ? `${tessuto.readable(shown)} ${chart.unit}` : tessuto.readable(shown);
};

/** A number for reading: three digits. */
tessuto.readable = value => {
  if (value === null || value === undefined || !isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e5) return value.toExponential(2);
  return String(Number(value.toPrecision(3)));
};
