"use strict";
/** The one place that knows which frame is shown. */
tessuto.Player = class {
  /** `fps`: of the video; `first`: number of its first frame. */
  constructor({ frameCount, fps, first }) {
    Object.assign(this, { frameCount, fps, first, frame: 0, playing: false, listeners: [] });
    this.speeds = [1, 0.5, 0.25, 0.1, 0.05];
    // A clip should last four seconds or more.
    this.speed = this.speeds.find(s => frameCount / (fps * s) >= 4) ?? 0.05;
  }

  /** Calls `listener(frame)` whenever another frame is to be shown. */
  listen(listener) {
    this.listeners.push(listener);
  }

  /** Shows frame `frame`, counted from 0. */
  seek(frame) {
    frame = Math.max(0, Math.min(this.frameCount - 1, Math.round(frame)));
    if (frame === this.frame) return;
    this.frame = frame;
    this.refresh();
  }

  /** Takes another number of frames. */
  setCount(frameCount) {
    this.frameCount = frameCount;
    this.onCount?.();
    this.seek(this.frame);
  }

  refresh() {
    for (const listener of this.listeners) listener(this.frame);
  }

  toggle(playing = !this.playing) {
    if (playing === this.playing || this.frameCount < 2) return;
    this.playing = playing;
    this.onToggle?.(playing);
    if (!playing) return;
    let start = performance.now(), from = this.frame;
    let speed = this.speed;
    const tick = () => {
      if (!this.playing) return;
      const now = performance.now();
      if (speed !== this.speed) [start, from, speed] = [now, this.frame, this.speed];
      const passed = Math.floor((now - start) / 1000 * this.fps * speed);
      this.seek((from + Math.max(passed, 0)) % this.frameCount);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** Stops, and shows the frame `by` further. */
  step(by) {
    this.toggle(false);
    this.seek(this.frame + by);
  }

  /** Joins the slider, the button and the keys. */
  bind({ bar, play, scrub, output, speed }) {
    bar.hidden = this.frameCount < 2;
    this.onCount = () => { scrub.max = this.frameCount - 1; };
    this.onCount();
    const digits = String(this.first + this.frameCount - 1).length;
    this.listen(frame => {
      scrub.value = frame;
      const number = String(this.first + frame).padStart(digits, "\u2007");
      output.textContent = `frame ${number} · ${(frame / this.fps).toFixed(2)} s`;
    });
    scrub.addEventListener("input", () => {
      this.toggle(false);
      this.seek(Number(scrub.value));
    });
    this.onToggle = playing => {
      play.classList.toggle("playing", playing);
      play.setAttribute("aria-label", playing ? "pause" : "play");
    };
    play.addEventListener("click", () => this.toggle());
    for (const s of this.speeds) speed.add(new Option(s === 1 ? "1×" : `${s}×`, s, false, s === this.speed));
    speed.addEventListener("change", () => { this.speed = Number(speed.value); });
  }

  /** Handles a key; true if it was one of the player's. */
  key(event) {
    const by = event.shiftKey ? 10 : 1;
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(-by),
      ArrowRight: () => this.step(by),
      Home: () => this.step(-this.frameCount),
      End: () => this.step(this.frameCount),
    };
    actions[event.key]?.();
    return event.key in actions;
  }
};
