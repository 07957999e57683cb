/** Step 1: drop, choose or take up a clip. */
import { byId, upload } from "./api.js";

const LARGEST = 8 * 2 ** 30;
const KINDS = { clip: "clip", scene: "scene", result: "result", begun: "begun, no scene yet" };

export const begin = studio => {
  const drop = byId("drop"), file = byId("file"), box = byId("upload");
  const bar = box.querySelector("progress"), text = box.querySelector("span");

  const take = async chosen => {
    if (!chosen) return;
    if (chosen.size > LARGEST) return studio.alarm(new Error("the clip is larger than 8 GB: cut it first"));
    box.hidden = false;
    try {
      const name = await upload(chosen, part => {
        bar.value = part;
        text.textContent = `${chosen.name}: ${Math.round(part * 100)} %`;
      });
      await studio.open(name);
    } catch (error) {
      studio.alarm(error);
    }
    box.hidden = true;
    file.value = "";
  };

  file.addEventListener("change", () => take(file.files[0]));
  const over = e => { e.preventDefault(); drop.classList.add("over"); };
  for (const kind of ["dragenter", "dragover"]) addEventListener(kind, over);
  addEventListener("dragleave", e => { if (!e.relatedTarget) drop.classList.remove("over"); });
  addEventListener("drop", e => {
    e.preventDefault();
    drop.classList.remove("over");
    if (studio.step === "clip") take(e.dataTransfer.files[0]);
  });

  let shown = "";
  return {
    update(state) {
      const entries = state.entries;
      if (!entries || JSON.stringify(entries) === shown) return;
      shown = JSON.stringify(entries);
      byId("known").hidden = entries.length === 0;
      byId("entries").replaceChildren(...entries.map(entry => {
        const item = document.createElement("li"), button = document.createElement("button");
        const name = document.createElement("b"), kind = document.createElement("small");
        name.textContent = entry.name.split("/").at(-1);
        const changed = new Date(entry.changed * 1000).toLocaleDateString();
        kind.textContent = `${KINDS[entry.kind]} · ${entry.name} · ${changed}`;
        button.append(name, kind);
        button.addEventListener("click", () => studio.open(entry.name).catch(studio.alarm));
        item.append(button);
        return item;
      }));
    },
  };
};
