"use strict";
/** Puts the page together; runs once, at its end. */
(() => {
  if (window.parent !== window) document.documentElement.classList.add("embedded");
  const byId = id => document.getElementById(id);
  const data = JSON.parse(byId("data").textContent);
  byId("data").remove();
  const { cloth, film, light, verdicts } = data;
  const hasFilm = film.layers.length > 0;
  const player = new tessuto.Player({
    frameCount: cloth?.frame_count ?? film.layers[0]?.frames.length ?? 1,
    fps: cloth?.fps ?? 25,
    first: cloth?.first_frame ?? 0,
  });
  byId("views").hidden = !cloth && !hasFilm;
  player.bind({
    bar: byId("transport"), play: byId("play"), scrub: byId("scrub"), output: byId("frame"), speed: byId("speed"),
  });

  /** Fills a select with pairs [key, label]. */
  const fill = (select, pairs) => select.append(...pairs.map(([key, label]) => new Option(label, key)));

  let view = null;
  if (cloth) {
    byId("cloth-panel").hidden = false;
    const elements = {
      canvas: byId("cloth"),
      box: byId("cloth-box"),
      probe: byId("probe"),
      legend: {
        root: byId("legend"), title: byId("legend-title"), bar: byId("legend-bar"),
        low: byId("legend-low"), middle: byId("legend-middle"), high: byId("legend-high"),
      },
    };
    // Images of their own: those in the page have the size of their layout for three.js, not that of their pixels.
    const images = {};
    for (const shown of document.querySelectorAll("img[id^=map-]")) {
      const image = images[shown.id.slice(4)] = new Image();
      image.src = shown.src;
    }
    try {
      view = new tessuto.ClothView(elements, cloth, light, images);
    } catch (error) {
      // Without WebGL all the rest still works.
      elements.box.classList.add("without");
      elements.box.dataset.reason = `The 3D view needs WebGL: ${error.message}`;
      console.warn(error);
    }
  }
  if (view) bindView(view);

  function bindView(view) {
    if (hasFilm) view.lens = film.camera;
    const look = byId("look");
    const list = () => {
      const chosen = look.value;
      look.replaceChildren(...view.looks().map(([label, members]) => {
        const group = document.createElement("optgroup");
        group.label = label;
        fill(group, members);
        return group;
      }));
      if ([...look.options].some(o => o.value === chosen)) look.value = chosen;
    };
    const light = byId("light"), turn = byId("turn");
    const choose = () => {
      for (const id of ["background-label", "light", "turn-label"]) byId(id).hidden = look.value !== "lit";
      view.setLook(look.value);
    };
    fill(light, view.lightChoices());
    light.addEventListener("change", () => view.setLight(light.value));
    turn.addEventListener("input", () => view.turnLight(Number(turn.value)));
    list();
    if (view.canBeLit) look.value = "lit";
    if (data.live && film.camera && view.motion) {
      const first = new Image();
      first.src = `data:image/jpeg;base64,${film.layers[0].frames[0]}`;
      view.wear(first, film.camera);
      list();
      look.value = "texture";
    }
    choose();
    look.addEventListener("change", choose);
    const wireframe = byId("wireframe"), background = byId("background");
    wireframe.addEventListener("change", () => view.setWireframe(wireframe.checked));
    background.addEventListener("change", () => view.setBackground(background.checked));
    const through = byId("through-camera");
    through.disabled = !(view.lens ?? cloth.camera);
    through.addEventListener("change", () => { through.checked = view.toggleCamera(); });
    view.onLeaveCamera = () => { through.checked = false; };
    view.setDark(tessuto.darkness.matches);
    tessuto.darkness.addEventListener("change", () => view.setDark(tessuto.darkness.matches));
    player.listen(frame => view.show(frame));
    view.refreshLooks = () => {
      list();
      choose();
    };
  }

  let wipe = null;
  if (hasFilm) {
    byId("film-panel").hidden = false;
    const shape = () => {
      const positions = (view.replay ?? view.motion).at(player.frame);
      return { positions: tessuto.seenFrom(view.poseAt(player.frame), positions), edges: view.surface.edges };
    };
    const mesh = view && shape;
    const elements = { canvas: byId("film"), box: byId("film-box"), handle: byId("handle") };
    wipe = new tessuto.Wipe(elements, film, mesh);
    const layer = byId("layer"), slider = byId("wipe");
    fill(layer, wipe.choices());
    if (data.live) layer.value = "mesh";
    const choose = () => {
      byId("layer-tag").textContent = layer.selectedOptions[0]?.textContent ?? "";
      wipe.setLayer(layer.value);
    };
    choose();
    layer.addEventListener("change", choose);
    slider.addEventListener("input", () => wipe.setShare(slider.value / 1000));
    wipe.onShare = share => { slider.value = Math.round(1000 * share); };
    player.listen(frame => wipe.show(frame));
  }

  const states = verdicts.length !== player.frameCount ? null : new tessuto.States(
    { root: byId("state"), strip: byId("states"), text: byId("state-text"), next: byId("next-doubt"),
      scrub: byId("scrub") },
    verdicts, player,
  );

  let causes = null;
  if (view && data.causes) {
    const elements = {
      bar: "cause-bar", arrows: "arrows", replays: "replays", note: "replay-note", legend: "arrow-legend",
      scale: "arrow-scale",
    };
    for (const [name, id] of Object.entries(elements)) elements[name] = byId(id);
    causes = new tessuto.Causes(elements, data.causes, { player, view, states });
  }

  const charts = new tessuto.Charts({
    main: document.querySelector("main"),
    frames: byId("frame-charts"),
    steps: byId("step-charts"),
    framesSection: byId("frame-charts-section"),
    stepsSection: byId("step-charts-section"),
  }, player);
  player.listen(() => charts.mark());
  player.refresh();
  // The curves can wait until the first frame is on the screen.
  setTimeout(() => charts.set(data.charts), 50);

  // “frame 34” in a text goes there.
  const link = number => {
    const a = document.createElement("a");
    a.href = `#frame-${number}`;
    a.textContent = `frame ${number}`;
    return a;
  };
  for (const place of document.querySelectorAll(".with-frames")) {
    const parts = place.textContent.split(/frame (\d+)/);
    if (parts.length > 1 && cloth) place.replaceChildren(...parts.map((text, k) => (k % 2 ? link(text) : text)));
  }
  const follow = () => {
    const number = /^#frame-(\d+)$/.exec(location.hash)?.[1];
    if (number === undefined) return;
    player.toggle(false);
    player.seek(number - player.first);
  };
  addEventListener("hashchange", follow);
  addEventListener("click", event => {
    if (!event.target.closest?.("a[href^='#frame-']")) return;
    // The same link again changes no address.
    follow();
    byId("views").scrollIntoView({ block: "nearest", behavior: "smooth" });
  });
  follow();

  const about = [];
  if (view?.motion) about.push(`positions to ±${(1e6 * view.motion.precision).toFixed(0)} µm`);
  if (hasFilm) about.push(`images ${film.width} × ${film.height} px, JPEG quality ${film.quality}`);
  if (about.length) byId("about").textContent =
    `In this page: ${about.join(", ")}. The full data are in the folder beside it.`;

  addEventListener("keydown", event => {
    const field = event.target.closest?.("select, summary, #wipe, a");
    if (event.ctrlKey || event.metaKey || event.altKey || (field && event.key !== "Escape")) return;
    const actions = {
      w: () => byId("wireframe").click(), c: () => byId("through-camera").click(),
      n: () => states?.next(event.shiftKey),
    };
    // A focused button would take the space for a click.
    const button = event.target.closest?.("button, input[type=checkbox]");
    if (button && event.key === " " && button.id !== "play") return;
    if (actions[event.key.toLowerCase()]) actions[event.key.toLowerCase()]();
    else if (player.key(event)) event.preventDefault();
  });
  byId("copy")?.addEventListener("click", async () => {
    const text = byId("command").textContent;
    // file:// pages may have no clipboard; then the text is selected for the user.
    try {
      await navigator.clipboard.writeText(text);
      byId("copy").textContent = "copied";
    } catch {
      getSelection().selectAllChildren(byId("command"));
    }
  });
  Object.assign(tessuto, { page: { player, view, wipe, charts, states, causes, data } });
})();
