/** What can be done by hand in a step, to the points or faces that are chosen. */
import { count, fill, h } from "../dom";
import type { Store } from "../store";
import type { Pointer } from "../tools/pointer";
import type { Selection } from "../tools/selection";

export function boundaryPanel(store: Store, selection: Selection, pointer: Pointer): HTMLElement {
  const element = h("div", { class: "hand" });
  const act = (action: "add" | "drop") => {
    store.send({ type: "Edit", edit: { boundary: { [action]: selection.named() } } });
    selection.clear();
  };
  const update = () => {
    const some = selection.count > 0;
    element.hidden = store.result("edges") === null;
    fill(
      element,
      h("h3", {}, "Correct by hand"),
      h("p", { class: "help" }, some ? `${count(selection.count)} points are chosen.` : "Choose points with the brush or the lasso, then add them to the edges or take them away."),
      h(
        "div",
        { class: "buttons" },
        !some && pointer.tool === "turn" && h("button", { onclick: () => pointer.use("lasso") }, "Take the lasso"),
        h("button", { id: "boundary-drop", disabled: !some, title: "These points lie on no edge (−)", onclick: () => act("drop") }, "Take from edges"),
        h("button", { id: "boundary-add", disabled: !some, title: "These points lie on an edge (+)", onclick: () => act("add") }, "Add to edges"),
        some && h("button", { onclick: () => selection.clear() }, "Choose none"),
      ),
    );
  };
  store.on(["selection", "step", "state"], update);
  update();
  return element;
}

export function facesPanel(store: Store, selection: Selection, pointer: Pointer): HTMLElement {
  const element = h("div", { class: "hand" });
  const step = (content: Record<string, unknown> | Record<string, unknown>[]) => {
    store.send({ type: "Edit", edit: { face: content } });
    selection.clear();
  };
  /** The same for every face that is chosen, as one edit: what one gesture does, one undo takes back. */
  const each = (made: (face: number) => Record<string, unknown>) => step(store.faces.length === 1 ? made(store.faces[0]!) : store.faces.map(made));
  let keeps = false;
  const update = () => {
    const [faces, some] = [store.faces, selection.count > 0];
    const one = faces.length === 1 ? faces[0]! : null;
    const entries = store.entries().filter((other) => faces.includes(other.number));
    const common = <T,>(values: T[]): T | null => (values.length && values.every((value) => value === values[0]) ? values[0]! : null);
    element.hidden = store.result("faces") === null;
    const kinds = h("select", { id: "face-kind", disabled: !faces.length, title: "Choose the type of the faces' surfaces", onchange: () => (kinds.value ? each((face) => ({ type: { face, kind: kinds.value } })) : update()) });
    fill(kinds, h("option", { value: "" }, "Type…"), ...(store.welcome?.kinds ?? []).map((kind) => h("option", { value: kind }, kind === "bspline" ? "bspline (NURBS)" : kind)));
    kinds.value = common(entries.map((entry) => entry.kind)) ?? "";
    const unit = store.state?.unit ?? "";
    const far = `How far the face's surface may lie from its points besides their noise, in ${unit}; it is as simple as that allows`;
    const given = () => {
      keeps = tolerance.value === "" && entries.some((entry) => entry.tolerance !== null);
      give();
    };
    const give = () => (Number(tolerance.value) > 0 ? each((face) => ({ tolerance: { face, value: Number(tolerance.value) } })) : update());
    const tolerance = h("input", { id: "face-tolerance", type: "number", min: "0", step: "any", disabled: !faces.length, placeholder: `Tolerance, ${unit}`, title: far, onchange: given });
    tolerance.value = String(common(entries.map((entry) => entry.tolerance)) ?? "");
    const said = [faces.length ? `Face ${faces.join(", ")} chosen` : "", some ? `${count(selection.count)} points chosen` : ""].filter(Boolean).join("; ");
    const points = () => selection.named();
    fill(
      element,
      h("h3", {}, "Correct by hand"),
      h("p", { class: "help" }, said ? `${said}.` : "Click a face in the picture or the list; Shift takes more. Lasso points to split a face or to give them to another."),
      keeps && h("p", { class: "help warning", id: "keeps-tolerance" }, "A face keeps its tolerance; to take it back, undo the step that gave it."),
      h(
        "div",
        { class: "buttons" },
        h("button", { id: "face-merge", disabled: faces.length < 2, title: "Make one face of those chosen; the first one's number stays (M)", onclick: () => (step({ merge: faces }), store.choose(faces[0]!, false)) }, "Merge"),
        kinds,
        tolerance,
        h("button", { id: "face-delete", disabled: faces.length === 0, title: "Delete the faces; their points belong to none (Del)", onclick: () => (each((face) => ({ delete: face })), store.choose(null, false)) }, "Delete"),
        h("button", { id: "face-split", disabled: one === null || !some, title: "The chosen points of the face become a new face (S)", onclick: () => step({ split: { face: one, ...points() } }) }, "Split off"),
        h("button", { id: "face-assign", disabled: one === null || !some, title: "The chosen points belong to the chosen face (G)", onclick: () => step({ assign: { face: one, ...points() } }) }, "Give to face"),
        h("button", { id: "face-none", disabled: !some, title: "The chosen points belong to no face, like strays (N)", onclick: () => step({ assign: { face: -1, ...points() } }) }, "Give to none"),
        pointer.tool === "turn" && !some && h("button", { onclick: () => pointer.use("lasso") }, "Take the lasso"),
        some && h("button", { onclick: () => selection.clear() }, "Choose none"),
      ),
    );
  };
  store.on(["faces", "state"], () => (keeps = false));
  store.on(["selection", "step", "faces", "state", "welcome", "frame"], update);
  update();
  return element;
}
