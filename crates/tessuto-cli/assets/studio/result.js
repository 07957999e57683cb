/** Step 6: the report, and files for other programs. */
import { byId, fileUrl } from "./api.js";

const size = bytes => bytes < 1e5 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
/** What a file is for, by the end of its name. */
const USES = [
  ["_blender.py", "sets up Blender: fabric, camera, video behind, light"], ["_blender_cloth.py", "settings for Blender's cloth simulation"],
  ["_pc2.obj", "the mesh that the point cache moves"], ["_textures", "texture and maps of the USD file"], ["_obj", "one mesh a frame"],
  [".glb", "moving mesh with texture: Blender, web, phones"], [".usda", "moving mesh with camera and light: Houdini, Unreal"],
  [".pc2", "point cache: Blender, Maya, Cinema 4D"], [".npz", "arrays for NumPy"],
];
const use = name => USES.find(([end]) => name.endsWith(end))?.[1] ?? "";
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
      byId("exports").hidden = !there;
      for (const button of document.querySelectorAll("[data-format]")) button.disabled = Boolean(work.job?.running);
      // A report that is written anew has another address; looking is no reason to load it again.
      const shown = there && studio.step === "result" ? fileUrl(`${work.result_name}/report.html`, work.report_version) : address;
      if (shown !== address) {
        address = shown;
        report.hidden = !shown;
        report.src = shown;
      }
      byId("export-folder").textContent = work.export_folder ?? "";
      const files = JSON.stringify([work.exports, work.export_folders]);
      if (files === listed) return;
      listed = files;
      const row = (head, text, name) => {
        const item = document.createElement("li"), note = document.createElement("small");
        note.textContent = use(name);
        item.append(head, ` ${text}`, note);
        return item;
      };
      const last = name => name.split("/").at(-1);
      byId("files").replaceChildren(...work.exports.map(file => {
        const link = document.createElement("a"), name = last(file.name);
        link.href = `${fileUrl(file.name)}&download=1`;
        link.download = link.textContent = name;
        return row(link, size(file.bytes), name);
      }), ...work.export_folders.map(folder => {
        const name = last(folder.name);
        return row(`${name}/`, folder.files === 1 ? "1 file" : `${folder.files} files`, name);
      }));
    },
  };
};
