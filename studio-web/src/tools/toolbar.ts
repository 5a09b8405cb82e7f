/** Tools, views and colours above the picture. */
import { fill, h } from "../dom";
import type { Colouring, Store } from "../store";
import { VIEWS } from "../view/cameras";
import type { Sync } from "../view/sync";
import type { Viewer } from "../view/viewer";
import type { Pointer, Tool } from "./pointer";

const TOOLS: [Tool, string, string][] = [
  ["turn", "Turn", "Turn the view; click a face to choose it (1)"],
  ["brush", "Brush", "Choose points by painting over them; Alt takes away (2)"],
  ["lasso", "Lasso", "Choose points by drawing around them; Shift adds, Alt takes away (3)"],
];
const COLOURS: [Colouring, string][] = [
  ["plain", "One colour"],
  ["height", "Height"],
  ["strength", "Edge strength"],
  ["face", "Face"],
  ["deviation", "Deviation"],
];

export function toolbar(store: Store, viewer: Viewer, sync: Sync, pointer: Pointer): HTMLElement {
  const tools = h("div", { class: "group", role: "group", "aria-label": "Tools" });
  const reach = h("div", { class: "group" });
  const colours = h("select", { id: "colouring", title: "What points are coloured by (C)", onchange: () => sync.choose(colours.value as Colouring) });
  const camera = h("button", { id: "camera", title: "Orthographic or perspective (P)", onclick: () => switchCamera() });
  const views = h("select", { title: "Look from a side", "aria-label": "Standard views", onchange: () => (viewer.cameras.look(views.value), (views.value = "")) });
  fill(views, h("option", { value: "" }, "View…"), ...Object.keys(VIEWS).map((name) => h("option", { value: name }, name)));
  const switchCamera = () => (viewer.cameras.toggle(), viewer.draw(), update());

  function update(): void {
    fill(tools, ...TOOLS.map(([tool, text, title]) => h("button", { id: `tool-${tool}`, title, "aria-pressed": String(pointer.tool === tool), onclick: () => pointer.use(tool) }, text)));
    const through = (on: boolean, text: string, title: string) =>
      h("button", { id: on ? "through" : "visible", title, "aria-pressed": String(pointer.through === on), onclick: () => ((pointer.through = on), update()) }, text);
    fill(reach, through(false, "Visible only", "Choose only points that nothing hides (V)"), through(true, "Through", "Choose all points behind one another (V)"));
    reach.hidden = pointer.tool === "turn";
    const known = (colouring: Colouring) =>
      colouring === "strength" ? store.frames.has("edges") : colouring === "face" || colouring === "deviation" ? store.facesStep() !== null : true;
    fill(colours, ...COLOURS.map(([value, text]) => h("option", { value, disabled: !known(value) }, text)));
    colours.value = sync.colouring;
    camera.textContent = viewer.cameras.isPerspective ? "Perspective" : "Orthographic";
  }

  store.on(["selection", "state", "step", "frame"], update);
  update();
  const fit = h("button", { id: "fit", title: "Show everything (F)", onclick: () => (viewer.cameras.fit(), viewer.draw()) }, "Fit");
  return h("div", { class: "toolbar" }, tools, reach, h("span", { class: "space" }), h("label", { class: "inline" }, "Colour ", colours), views, fit, camera);
}
