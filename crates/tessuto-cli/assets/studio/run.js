/** Step 5: the reconstruction, with its live page. */
import { byId, post } from "./api.js";

export const run = studio => {
  const live = byId("live"), bar = byId("run-bar");
  let address = "";
  byId("stop").addEventListener("click", () => post("/api/stop", {}).catch(studio.alarm));
  byId("run-next").addEventListener("click", () => studio.run({ step: "reconstruct" }).catch(studio.alarm));

  return {
    update({ work }) {
      const job = work.job?.step === "reconstruct" ? work.job : null, running = Boolean(job?.running);
      const progress = job?.progress ?? "",
        left = /, (?:about )?((?:maybe )?[\d.]+ (?:s|min|h)) left/.exec(progress)?.[1],
        stage = /^stage (\d+ of \d+), ([^,(]*)/.exec(progress);
      byId("run-title").textContent = running ? "Reconstructing"
        : work.result && job?.ended === "ok" ? "Done"
        : job || work.interrupted ? "Not finished" : "Ready";
      bar.hidden = !running;
      if (typeof job?.fraction === "number") bar.value = job.fraction;
      else bar.removeAttribute("value");
      byId("run-text").textContent = !running ? ""
        : stage ? `${left ? `${left} left · ` : ""}stage ${stage[1]}: ${stage[2].trim()}` : "Reading the scene …";
      byId("stop").hidden = !running || Boolean(job?.orphan);
      byId("run-again").hidden = running || Boolean(work.job?.running) || job?.ended === "ok";
      byId("run-next").textContent = work.interrupted ? "Go on" : "Start the reconstruction";
      byId("run-note").textContent = work.interrupted ? "It goes on where it stopped; the result is the same." : "";
      byId("run-log").textContent = [job?.text, progress].filter(Boolean).join("\n");
      const shown = running && job.live ? job.live : "";
      if (shown !== address) {
        address = shown;
        live.hidden = !shown;
        live.src = shown || "about:blank";
      }
    },
  };
};
