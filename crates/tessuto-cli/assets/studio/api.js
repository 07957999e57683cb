/** What the page asks of the server. */

export const byId = id => document.getElementById(id);

/** Where a file of the project is; another `version` is another address, so that no old copy is shown. */
export const fileUrl = (name, version = "") =>
  `/file/${name.split("/").map(encodeURIComponent).join("/")}?v=${version}`;

const told = async answer => {
  const text = await answer.text();
  const said = text.trim() || `the studio answered ${answer.status}`;
  if (!answer.ok) throw Object.assign(new Error(said), { status: answer.status });
  return text ? JSON.parse(text) : null;
};

export const get = async path => told(await fetch(path));

export const post = async (path, value) =>
  told(await fetch(path, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value),
  }));

/** Copies `file` into the project; `progress` receives the part that is done. fetch() has none. */
export const upload = (file, progress) => new Promise((done, failed) => {
  const request = new XMLHttpRequest();
  request.open("PUT", `/api/upload?name=${encodeURIComponent(file.name)}`);
  request.upload.onprogress = e => progress(e.total ? e.loaded / e.total : 0);
  request.onerror = () => failed(new Error("the copy broke off: is the studio still running?"));
  request.onload = () => request.status === 200
    ? done(JSON.parse(request.responseText).name)
    : failed(new Error(request.responseText));
  request.send(file);
});

/** An image, decoded. */
export const loadImage = async url => {
  const image = new Image();
  image.src = url;
  await image.decode();
  return image;
};

/** Makes the bitmap of `canvas` as large as it is shown, for an image of this size within `box`; scale of the image. */
export const fitCanvas = (canvas, width, height, highest = 0.62) => {
  const most = canvas.parentElement.clientWidth, tallest = Math.max(260, innerHeight * highest);
  const scale = Math.min(most / width, tallest / height), dense = devicePixelRatio || 1;
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  canvas.style.width = `${w}px`;
  canvas.style.height = `${h}px`;
  const [bw, bh] = [Math.round(w * dense), Math.round(h * dense)];
  if (canvas.width !== bw || canvas.height !== bh) Object.assign(canvas, { width: bw, height: bh });
  return bw / width;
};

/** A number as people write it; NaN if it is none. */
export const number = text => {
  const plain = text.trim().replace(",", ".");
  return plain === "" ? NaN : Number(plain);
};
