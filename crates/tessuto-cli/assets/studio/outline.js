/**
 * Step 3, left: the fabric's outline in the first frame, of a sheet or of any shape. Points are pixels of the clip,
 * centres at whole numbers.
 */
import { byId, fitCanvas } from "./api.js";

const CORNERS = 4, GRAB = 14, LENS = 66, ZOOM = 7;

/** Corners clockwise from the upper left. */
const ordered = points => {
  const cx = points.reduce((s, p) => s + p.x, 0) / points.length,
    cy = points.reduce((s, p) => s + p.y, 0) / points.length;
  const turn = [...points].sort((a, b) => Math.atan2(a.y - cy, a.x - cx) - Math.atan2(b.y - cy, b.x - cx));
  const first = turn.reduce((best, p, k) => p.x + p.y < turn[best].x + turn[best].y ? k : best, 0);
  return [...turn.slice(first), ...turn.slice(0, first)];
};

/** Distance of `q` to the side from `a` to `b`. */
const toSide = (q, a, b) => {
  const [dx, dy] = [b.x - a.x, b.y - a.y],
    t = Math.max(0, Math.min(1, ((q.x - a.x) * dx + (q.y - a.y) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(q.x - a.x - t * dx, q.y - a.y - t * dy);
};

export const outline = (canvas, changed) => {
  let image = null, scale = 1, points = [], past = [], chosen = -1, dragging = false, pointer = null, cursor = null;
  /** Of another shape than a sheet: whether its border is complete, and what was measured. */
  let other = false, closed = false, length = "", pressed = null;
  const pen = canvas.getContext("2d");
  const corners = () => points.filter(p => p.corner).length;
  const toImage = e => {
    const box = canvas.getBoundingClientRect(), unit = canvas.width / box.width / scale;
    return { x: (e.clientX - box.left) * unit - 0.5, y: (e.clientY - box.top) * unit - 0.5 };
  };
  const place = p => [(p.x + 0.5) * scale, (p.y + 0.5) * scale];
  const reach = () => GRAB * (devicePixelRatio || 1) / scale;
  const inside = p => ({
    x: Math.max(0, Math.min(image.width - 1, p.x)),
    y: Math.max(0, Math.min(image.height - 1, p.y)),
  });

  const complete = () => other ? closed : corners() === CORNERS;
  const remember = () => {
    past.push({ points: points.map(p => ({ ...p })), closed });
    if (past.length > 200) past.shift();
  };
  const done = () => { changed(points, closed); draw(); };

  /** Completes the border; until others are chosen, the two points farthest apart are those measured between. */
  const close = () => {
    if (!other || closed || points.length < 3) return;
    remember();
    closed = true;
    chosen = -1;
    if (points.filter(p => p.measured).length !== 2) {
      let far = [0, 1], most = -1;
      points.forEach((p, i) => points.slice(0, i).forEach((q, j) => {
        const apart = Math.hypot(p.x - q.x, p.y - q.y);
        if (apart > most) [most, far] = [apart, [j, i]];
      }));
      points.forEach((p, k) => { p.measured = far.includes(k); });
    }
    done();
  };

  const add = at => {
    const p = { ...inside(at), corner: !other && corners() < CORNERS };
    if (other && !closed) {
      const [first] = points;
      if (points.length >= 3 && Math.hypot(p.x - first.x, p.y - first.y) < reach()) return close();
      remember();
      points.push(p);
      chosen = points.length - 1;
      return done();
    }
    if (p.corner) {
      remember();
      points.push(p);
      if (corners() === CORNERS) points = ordered(points);
      chosen = points.findIndex(q => q.x === p.x && q.y === p.y);
      return done();
    }
    const sides = points.map((a, k) => toSide(p, a, points[(k + 1) % points.length]));
    const side = sides.indexOf(Math.min(...sides));
    if (sides[side] > 2 * reach()) return;
    remember();
    points.splice(side + 1, 0, p);
    chosen = side + 1;
    done();
  };

  const lens = at => {
    const dense = devicePixelRatio || 1, radius = LENS * dense, [x, y] = place(at);
    const left = x > canvas.width / 2, up = y > 2.4 * radius;
    const [cx, cy] = [x + (left ? -1 : 1) * radius * 1.3, y + (up ? -1 : 1) * radius * 1.3];
    const half = radius / ZOOM / dense;
    pen.save();
    pen.beginPath();
    pen.arc(cx, cy, radius, 0, 7);
    pen.fillStyle = "#000";
    pen.fill();
    pen.clip();
    pen.imageSmoothingEnabled = false;
    pen.drawImage(image, at.x + 0.5 - half, at.y + 0.5 - half, 2 * half, 2 * half, cx - radius, cy - radius,
      2 * radius, 2 * radius);
    pen.strokeStyle = "rgb(255 255 255 / 85%)";
    pen.lineWidth = dense;
    pen.beginPath();
    for (const [dx, dy] of [[1, 0], [0, 1]]) {
      for (const sign of [-1, 1]) {
        pen.moveTo(cx + sign * dx * 7 * dense, cy + sign * dy * 7 * dense);
        pen.lineTo(cx + sign * dx * radius, cy + sign * dy * radius);
      }
    }
    pen.stroke();
    pen.restore();
    pen.beginPath();
    pen.arc(cx, cy, radius, 0, 7);
    pen.strokeStyle = "#fff";
    pen.lineWidth = 3 * dense;
    pen.stroke();
  };

  const label = (text, a, b) => {
    const dense = devicePixelRatio || 1, [ax, ay] = place(a), [bx, by] = place(b);
    const [mx, my] = points.map(place)
      .reduce(([x, y], [px, py]) => [x + px / points.length, y + py / points.length], [0, 0]);
    const [x, y] = [(ax + bx) / 2, (ay + by) / 2], far = Math.hypot(x - mx, y - my) || 1;
    pen.font = `600 ${13 * dense}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const [tx, ty] = [x - (x - mx) / far * 34 * dense, y - (y - my) / far * 20 * dense],
      wide = pen.measureText(text).width;
    pen.fillStyle = "rgb(0 0 0 / 65%)";
    pen.fillRect(tx - wide / 2 - 6 * dense, ty - 10 * dense, wide + 12 * dense, 20 * dense);
    pen.fillStyle = "#fff";
    pen.fillText(text, tx, ty);
  };

  /** The points' numbers, and what was measured. */
  const numbers = dense => {
    const ends = points.filter(p => p.measured);
    if (closed && ends.length === 2) {
      pen.setLineDash([7 * dense, 5 * dense]);
      for (const [color, width] of [["rgb(0 0 0 / 55%)", 4], ["#5fd4f4", 2]]) {
        pen.beginPath();
        ends.forEach((p, k) => pen[k ? "lineTo" : "moveTo"](...place(p)));
        pen.strokeStyle = color;
        pen.lineWidth = width * dense;
        pen.stroke();
      }
      pen.setLineDash([]);
      if (length) label(length, ...ends);
    }
    pen.font = `600 ${12 * dense}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    points.forEach((p, k) => {
      const [x, y] = place(p), up = y > 24 * dense ? -1 : 1;
      pen.lineWidth = 3 * dense;
      pen.strokeStyle = "rgb(0 0 0 / 75%)";
      pen.strokeText(k + 1, x, y + up * 16 * dense);
      pen.fillStyle = p.measured && closed ? "#5fd4f4" : "#fff";
      pen.fillText(k + 1, x, y + up * 16 * dense);
    });
  };

  const draw = () => {
    if (!image) return;
    const dense = devicePixelRatio || 1;
    scale = fitCanvas(canvas, image.width, image.height);
    pen.drawImage(image, 0, 0, canvas.width, canvas.height);
    if (points.length > 1) {
      for (const [color, width] of [["rgb(0 0 0 / 55%)", 4], ["#ffd23f", 2]]) {
        pen.beginPath();
        points.forEach((p, k) => pen[k ? "lineTo" : "moveTo"](...place(p)));
        if (complete()) pen.closePath();
        pen.strokeStyle = color;
        pen.lineWidth = width * dense;
        pen.stroke();
      }
    }
    points.forEach((p, k) => {
      pen.beginPath();
      pen.arc(...place(p), (p.corner ? 7 : 5) * dense, 0, 7);
      pen.fillStyle = k === chosen ? "#ff5a36" : "#ffd23f";
      pen.fill();
      pen.strokeStyle = "#1c2126";
      pen.lineWidth = 1.5 * dense;
      pen.stroke();
    });
    if (other) numbers(dense);
    if (!other && corners() === CORNERS) {
      const [a, b, c] = points.filter(p => p.corner);
      label("width", a, b);
      label("height", b, c);
    }
    if (cursor && !pointer) {
      const [x, y] = place(cursor);
      pen.strokeStyle = "#ff5a36";
      pen.lineWidth = 2 * dense;
      pen.strokeRect(x - 9 * dense, y - 9 * dense, 18 * dense, 18 * dense);
    }
    const at = dragging ? points[chosen] : pointer ?? cursor;
    if (at && (dragging || !complete() || !pointer && document.activeElement === canvas)) lens(at);
  };

  canvas.addEventListener("pointerdown", e => {
    if (!image || e.button !== 0) return;
    const at = toImage(e), near = points.map(p => Math.hypot(p.x - at.x, p.y - at.y)),
      best = near.indexOf(Math.min(...near));
    if (best >= 0 && near[best] < reach()) {
      remember();
      [chosen, dragging, pressed] = [best, true, { at, x: points[best].x, y: points[best].y }];
      canvas.setPointerCapture(e.pointerId);
      return draw();
    }
    add(at);
  });
  canvas.addEventListener("pointermove", e => {
    if (!image) return;
    pointer = toImage(e);
    if (dragging) Object.assign(points[chosen], inside(pointer));
    draw();
  });
  canvas.addEventListener("pointerup", e => {
    if (!dragging) return;
    dragging = false;
    const { x, y } = toImage(e), stayed = Math.hypot(x - pressed.at.x, y - pressed.at.y) < reach() / 3;
    // The first point again: the border is complete. A hand that clicks trembles.
    if (stayed && chosen === 0 && other && !closed && points.length >= 3) {
      past.pop();
      Object.assign(points[0], { x: pressed.x, y: pressed.y });
      return close();
    }
    done();
  });
  canvas.addEventListener("pointerleave", () => { pointer = null; draw(); });
  canvas.addEventListener("blur", () => { cursor = null; draw(); });
  canvas.addEventListener("keydown", e => {
    const step = e.shiftKey ? 10 : e.altKey ? 0.1 : 1;
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    if (!image) return;
    if (move) {
      const middle = { x: Math.round(image.width / 2), y: Math.round(image.height / 2) };
      const p = chosen >= 0 ? points[chosen] : cursor ??= middle;
      if (chosen >= 0) remember();
      Object.assign(p, inside({ x: p.x + move[0] * step, y: p.y + move[1] * step }));
      pointer = null;
      if (chosen >= 0) done(); else draw();
    } else if (e.key === "Enter" && cursor) {
      add(cursor);
      chosen = -1;
    } else if (e.key === "Escape") {
      chosen = -1;
      draw();
    } else if (e.key === "PageDown" || e.key === "PageUp") {
      chosen = points.length
        ? (chosen + (e.key === "PageDown" ? 1 : points.length - 1 + (chosen < 0))) % points.length : -1;
      draw();
    } else if ((e.key === "Delete" || e.key === "Backspace") && chosen >= 0) {
      remember();
      points.splice(chosen, 1);
      // Without one of its corners a bent side has no meaning.
      if (!other && corners() < CORNERS) points = points.filter(p => p.corner);
      if (points.length < 3) closed = false;
      chosen = -1;
      done();
    } else return;
    e.preventDefault();
  });
  addEventListener("resize", draw);

  return {
    draw,
    corners,
    close,
    complete,
    set(next, form) {
      [points, other, closed] = [next.map(p => ({ ...p })), form.shape === "other", form.closed];
      [past, chosen] = [[], -1];
      draw();
    },
    /** From here on the border is another one: that of a sheet, or any. */
    reshape(to) {
      if (other === to) return;
      const whole = complete();
      other = to;
      past = [];
      chosen = -1;
      if (other) {
        points.forEach(p => { p.corner = false; });
        if (whole) return close();
      } else if (points.length <= CORNERS) {
        points = points.map(({ x, y }) => ({ x, y, corner: true }));
        if (points.length === CORNERS) points = ordered(points);
      } else points = [];
      closed = false;
      done();
    },
    /** Points `ends` are those between which was measured. */
    measure(ends) {
      remember();
      points.forEach((p, k) => { p.measured = ends.includes(k); });
      done();
    },
    /** How long it is between them, in words. */
    measured(text) { if (length !== text) { length = text; draw(); } },
    show(next) { image = next; draw(); },
    undo() {
      if (!past.length) return;
      ({ points, closed } = past.pop());
      chosen = -1;
      done();
    },
    clear() {
      if (!points.length) return;
      remember();
      [points, closed, chosen] = [[], false, -1];
      done();
    },
    /** The next side becomes the upper one. */
    turn() {
      if (corners() < CORNERS) return;
      remember();
      do points.push(points.shift()); while (!points[0].corner);
      done();
    },
  };
};
