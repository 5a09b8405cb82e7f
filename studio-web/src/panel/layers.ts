/** Switch and fade what is drawn. */
import { fill, h } from "../dom";
import type { Store } from "../store";
import type { LayerName, Viewer } from "../view/viewer";

const NAMES: [LayerName, string][] = [
  ["points", "Points"],
  ["curves", "Curves"],
  ["surfaces", "Surfaces"],
  ["nets", "Control nets"],
  ["model", "Model"],
];

export function layersPanel(store: Store, viewer: Viewer): HTMLElement {
  const body = h("div", {});
  let shown = "";
  const update = () => {
    const rows = NAMES.filter(([name]) => name === "points" || viewer.layers.get(name)!.parts.some((part) => part.object.geometry.getAttribute("position").count > 0));
    const key = rows.map(([name]) => name + String(viewer.layers.get(name)!.on)).join();
    if (key === shown) return;
    shown = key;
    fill(body, ...rows.map(([name, text]) => row(viewer, name, text)));
  };
  store.on(["frame", "step", "state"], () => (arrange(store, viewer), update()));
  update();
  return h("details", { class: "layers", open: true }, h("summary", {}, "Layers"), body);
}

function row(viewer: Viewer, name: LayerName, text: string): HTMLElement {
  const layer = viewer.layers.get(name)!;
  const box = h("input", { type: "checkbox", id: `layer-${name}`, checked: layer.on, onchange: () => viewer.switch(name, box.checked, Number(slider.value)) });
  const slider = h("input", { type: "range", min: "0.05", max: "1", step: "0.05", "aria-label": `Fade ${text}`, oninput: () => viewer.switch(name, box.checked, Number(slider.value)) });
  slider.value = String(layer.opacity);
  return h("div", { class: "layer" }, h("label", {}, box, text), slider);
}

let arranged = "";

/** A step begins with the layers that belong to it; from then on they are the person's. */
function arrange(store: Store, viewer: Viewer): void {
  const late = store.step === "model" || store.step === "export";
  const key = store.step + String(late && store.frames.has("model"));
  if (key === arranged) return;
  arranged = key;
  const points = viewer.layers.get("points")!;
  viewer.switch("points", !(late && store.frames.has("model")), points.opacity);
  const surfaces = viewer.layers.get("surfaces")!;
  viewer.switch("surfaces", true, surfaces.opacity);
}
