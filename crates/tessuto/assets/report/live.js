"use strict";
/** While the reconstruction runs: asks once a second what is new, and shows it. */
(() => {
  const { data, view, charts, player } = tessuto.page;
  if (!data.live) return;
  const byId = id => document.getElementById(id);
  let version = 0, motion = 0, failures = 0, followed = 0;
  const stages = [];

  const show = news => {
    version = news.version;
    const { stage, step, of } = news.state;
    if (stage) {
      if (stages.at(-1) !== stage) stages.push(stage);
      byId("stage").textContent = stage;
      byId("stages").textContent = stages.length > 1 ? `after ${stages.slice(0, -1).join(", ")}` : "";
      byId("stage-note").textContent = `step ${step} of ${of}`;
      Object.assign(byId("progress"), { max: of, value: step });
    }
    charts.set(news.state.charts);
    if (news.state.motion && view) {
      motion = news.motion;
      view.setMotion(news.state.motion);
      view.refreshLooks();
      // While frames are added, the newest one is shown, until the user goes elsewhere.
      const newest = view.motion.frames - 1;
      if (!player.playing && player.frame === followed && newest > followed) player.seek(followed = newest);
      else player.refresh();
    }
  };

  const end = text => {
    byId("stage").textContent = text;
    document.querySelector(".dot").classList.add("ended");
    byId("progress").hidden = true;
    byId("stage-note").textContent = "";
  };

  const ask = async () => {
    let wait = 1000;
    try {
      const answer = await fetch(`/state?version=${version}&motion=${motion}`);
      failures = 0;
      if (answer.status === 200) {
        const news = await answer.json();
        if (news.finished) return location.reload();
        show(news);
        if (news.ended) return end("ended; the terminal says why");
      }
    } catch {
      if (++failures > 3) return end("the program has ended");
      wait = 500;
    }
    setTimeout(ask, wait);
  };
  ask();
})();
