"use strict";
/** The choice of arrows and of changed replays. */
tessuto.Causes = class {
  /**
   * `elements`: bar, arrows, replays, note, legend, scale; `data`: see `CauseData` in causes.rs; `parts`: player, view,
   * states.
   */
  constructor(elements, data, parts) {
    Object.assign(this, { elements, data, ...parts });
    elements.bar.hidden = !data.forces.length && !data.replays.length;
    if (data.forces.length) this.bindArrows();
    if (data.replays.length) this.bindReplays();
  }

  button(text, click) {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("aria-pressed", "false");
    button.append(text);
    button.addEventListener("click", click);
    return button;
  }

  bindArrows() {
    const { elements, view, data } = this;
    const arrows = view.makeArrows(data);
    elements.arrows.hidden = false;
    const dots = [];
    for (const { key, label } of data.forces) {
      const button = this.button(label, () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", on);
        arrows.toggle(key, on);
        view.show(view.frame);
        this.measure();
      });
      button.dataset.force = key;
      const dot = document.createElement("i");
      button.prepend(dot);
      dots.push(dot);
      elements.arrows.append(button);
    }
    const paint = () => {
      const dark = tessuto.darkness.matches;
      arrows.paint(dark);
      dots.forEach((dot, k) => { dot.style.background = tessuto.Arrows.colours(dark)[k]; });
      view.draw();
    };
    paint();
    tessuto.darkness.addEventListener("change", paint);
    view.controls.addEventListener("change", () => this.measure());
    new ResizeObserver(() => this.measure()).observe(view.elements.box);
  }

  /** The legend: how long arrows are on the screen, at the fabric's distance. */
  measure() {
    const { legend, scale } = this.elements, { view } = this, { arrows } = view;
    legend.hidden = !arrows?.shown || Boolean(view.replay);
    if (legend.hidden) return;
    const bars = [1, 10, 100, 1000].map(size => [size, view.pixels(arrows.length(size))])
      .filter(([, width]) => width >= 3 && width <= 170);
    scale.replaceChildren(...bars.map(([size, width]) => {
      const row = document.createElement("div"), bar = document.createElement("i");
      bar.style.width = `${width.toFixed(0)}px`;
      row.append(bar, `${size} m/s²`);
      return row;
    }));
  }

  bindReplays() {
    const { elements, data } = this;
    elements.replays.hidden = false;
    const all = [{ key: "found", label: "as found" }, ...data.replays];
    this.buttons = all.map(replay => {
      const button = this.button(replay.label, () => this.play(replay));
      button.dataset.replay = replay.key;
      return button;
    });
    elements.replays.append(...this.buttons);
    this.buttons[0].setAttribute("aria-pressed", "true");
  }

  /** Plays a changed replay, or again what was found. */
  play({ key, motion, note, from }) {
    const { elements, player, view, states } = this;
    this.buttons.forEach(button => button.setAttribute("aria-pressed", button.dataset.replay === key));
    player.toggle(false);
    view.setReplay(motion ?? null);
    player.setCount(motion ? motion.frames : view.data.frame_count);
    // Verdicts are on the video's frames.
    if (states) states.elements.root.hidden = states.elements.strip.hidden = Boolean(motion);
    elements.note.textContent = motion ? `${note} Dark threads: as found.` : "";
    for (const button of elements.arrows.children) button.disabled = Boolean(motion);
    view.refreshLooks();
    this.measure();
    if (!motion) return player.refresh();
    // A little of the clip comes before what goes on after it.
    player.seek(Math.max(0, from - 5));
    player.refresh();
    player.toggle(true);
  }
};
