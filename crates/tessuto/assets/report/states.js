"use strict";
/** The verdict on every frame: a strip below the slider, the reason in words, the way from one doubt to the next. */
tessuto.States = class {
  /** `verdicts`: see `FrameVerdict` in metrics; `elements`: root, strip, text, next, scrub. */
  constructor(elements, verdicts, player) {
    Object.assign(this, { elements, player });
    this.verdicts = verdicts;
    const { root, strip, next, scrub } = elements;
    root.hidden = strip.hidden = false;
    strip.replaceChildren(...this.runs().map(run => this.mark(run)));
    next.hidden = verdicts.every(v => v.state === "found");
    next.addEventListener("click", () => this.next());
    strip.addEventListener("pointermove", event => { strip.title = this.words(this.at(event)); });
    strip.addEventListener("click", event => {
      player.toggle(false);
      player.seek(this.at(event));
    });
    // What the slider is at, for those who hear it.
    player.listen(frame => {
      this.show(frame);
      scrub.setAttribute("aria-valuetext", this.words(frame));
    });
  }

  /** Stretches of one state: {state, start, end}, indices of the first frame and of one past the last. */
  runs() {
    const runs = [];
    this.verdicts.forEach(({ state }, k) => {
      if (runs.at(-1)?.state === state) runs.at(-1).end = k + 1;
      else runs.push({ state, start: k, end: k + 1 });
    });
    return runs;
  }

  /** The part of the strip for `run`: each frame takes the way from half a frame before to half a frame after it. */
  mark({ state, start, end }) {
    const last = Math.max(1, this.verdicts.length - 1);
    const percent = k => 100 * Math.max(0, Math.min(last, k - 0.5)) / last;
    const mark = document.createElement("i");
    mark.className = state;
    mark.style.left = `${percent(start)}%`;
    mark.style.width = `${percent(this.verdicts.length === 1 ? 2 : end) - percent(start)}%`;
    return mark;
  }

  /** Index of the frame below the pointer. */
  at(event) {
    const { left, width } = this.elements.strip.getBoundingClientRect();
    const k = Math.round((event.clientX - left) / Math.max(width, 1) * (this.verdicts.length - 1));
    return Math.max(0, Math.min(this.verdicts.length - 1, k));
  }

  words(k) {
    if (k >= this.verdicts.length) return "after the clip";
    const { frame, state, reason } = this.verdicts[k];
    return `frame ${frame}, ${state}${reason && `: ${reason}`}`;
  }

  show(k) {
    if (k >= this.verdicts.length) return;
    const { state, reason } = this.verdicts[k], name = document.createElement("b");
    name.textContent = state;
    name.className = state;
    this.elements.text.replaceChildren(name, reason && ` ${reason}`);
  }

  /** Goes to the next stretch of doubtful or lost frames, or to the one before; from the last to the first. */
  next(backwards = false) {
    const starts = this.runs().filter(run => run.state !== "found").map(run => run.start);
    if (!starts.length) return;
    const frame = this.player.frame;
    const target = backwards
      ? starts.findLast(k => k < frame) ?? starts.at(-1)
      : starts.find(k => k > frame) ?? starts[0];
    this.player.toggle(false);
    this.player.seek(target);
  }
};
