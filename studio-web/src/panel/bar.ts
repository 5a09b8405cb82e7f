/** The line on top: the project, undo and redo, help. */
import { h, write } from "../dom";
import type { Store } from "../store";

export function topBar(store: Store, help: () => void): HTMLElement {
  const name = h("span", { class: "scan-name" });
  const undo = h("button", { id: "undo", onclick: () => store.send({ type: "Undo" }) }, "↶ Undo");
  const redo = h("button", { id: "redo", onclick: () => store.send({ type: "Redo" }) }, "↷ Redo");
  const update = () => {
    const state = store.state;
    write(name, state?.scan || "no scan");
    name.title = state?.project ? `Project: ${state.project}` : "";
    undo.disabled = !state?.can_undo;
    redo.disabled = !state?.can_redo;
    const done = state?.edits.filter((edit) => edit.done) ?? [];
    undo.title = `${done.length ? `Undo: ${done[done.length - 1]!.text}` : "Nothing to undo"} (Ctrl+Z)`;
    redo.title = `${state?.can_redo ? `Redo: ${state.edits[done.length]!.text}` : "Nothing to redo"} (Ctrl+Shift+Z)`;
    document.title = `${state?.scan ? `${state.scan} – ` : ""}scan2nurbs studio`;
  };
  store.on(["state"], update);
  update();
  return h("header", { class: "top" }, h("b", {}, "scan2nurbs"), name, h("span", { class: "space" }), undo, redo, h("button", { id: "help", title: "Keyboard shortcuts (?)", onclick: help }, "?"));
}
