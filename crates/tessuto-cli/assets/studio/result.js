/** Step 6: the report, and files for other programs. */
import { byId, fileUrl } from "./api.js";

const size = bytes => bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
const TITLES = { found: "The fabric is found", doubtful: "Found, with doubts", lost: "Lost in places" };

export const result = studio => {
  const report = byId("report");
  let address = "", listed = "";
  /** A button for every format that the program can write; the first is the usual one. */
  const offer = formats => {
    const button = ({ key, programs }, k) => {
      const button = document.createElement("button");
      button.dataset.format = key;
      button.className = k === 0 ? "primary" : "";
      button.textContent = `${programs} (${key.toUpperCase()})`;
      button.addEventListener("click", () => studio.run({ step: "export", formats: [key] }).catch(studio.alarm));
      return button;
    };
    byId("exports").append(...formats.map(button));
  };

  return {
    update({ work, formats }) {
      if (!document.querySelector("[data-format]")) offer(formats);
      const there = work.result !== null && work.result !== undefined;
      const verdict = work.summary?.verdict;
      byId("verdict").textContent = TITLES[verdict?.state] ?? (there ? "Result" : "No result yet");
      byId("exports").hidden = !there;
      for (const button of document.querySelectorAll("[data-format]")) button.disabled = Boolean(work.job?.running);
      // A report that is written anew has another address; looking is no reason to load it again.
      const shown = there && studio.step === "result"
        ? fileUrl(`${work.result_name}/report.html`, work.report_version)
        : address;
      if (shown !== address) {
        address = shown;
        report.hidden = !shown;
        report.src = shown;
      }
      byId("export-folder").textContent = work.export_folder ?? "";
      const files = JSON.stringify([work.exports, work.export_folders]);
      if (files === listed) return;
      listed = files;
      const row = (head, text, use) => {
        const item = document.createElement("li"), note = document.createElement("small");
        note.textContent = use ?? "";
        item.append(head, ` ${text}`, note);
        return item;
      };
      const last = name => name.split("/").at(-1);
      byId("files").replaceChildren(...work.exports.map(file => {
        const link = document.createElement("a"), name = last(file.name);
        link.href = `${fileUrl(file.name)}&download=1`;
        link.download = link.textContent = name;
        return row(link, size(file.bytes), file.use);
      }), ...work.export_folders.map(folder => {
        const name = last(folder.name);
        return row(`${name}/`, folder.files === 1 ? "1 file" : `${folder.files} files`, folder.use);
      }));
    },
  };
};
