/** Step 6: the report, and files for other programs. */
import { byId, fileUrl } from "./api.js";

const size = bytes => bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
const TITLES = { found: "The fabric is found", doubtful: "Found, with doubts", lost: "Lost in places" };

export const result = studio => {
  const report = byId("report");
  let address = "", listed = "";
  for (const button of document.querySelectorAll("[data-format]")) {
    button.addEventListener("click", () => studio.run({ step: "export", formats: [button.dataset.format] }).catch(studio.alarm));
  }

  return {
    update({ work }) {
      const there = work.result !== null && work.result !== undefined;
      const verdict = work.summary?.verdict;
      byId("verdict").textContent = TITLES[verdict?.state] ?? (there ? "Result" : "No result yet");
      byId("sentence").textContent = verdict?.sentence ?? "";
      byId("exports").hidden = !there;
      for (const button of document.querySelectorAll("[data-format]")) button.disabled = Boolean(work.job?.running);
      // A report that is written anew has another address; looking is no reason to load it again.
      const shown = there && studio.step === "result" ? fileUrl(`${work.result_name}/report.html`, work.report_version) : address;
      if (shown !== address) {
        address = shown;
        report.hidden = !shown;
        report.src = shown;
      }
      const files = JSON.stringify(work.exports);
      if (files === listed) return;
      listed = files;
      byId("files").replaceChildren(...work.exports.map(file => {
        const item = document.createElement("li"), link = document.createElement("a"), name = file.name.split("/").at(-1);
        link.href = `${fileUrl(file.name)}&download=1`;
        link.download = link.textContent = name;
        item.append(link, ` ${size(file.bytes)}`);
        return item;
      }));
    },
  };
};
