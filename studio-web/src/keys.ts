/** Keyboard shortcuts, and the page that lists them. */
import { h } from "./dom";
import { STEPS } from "./messages";
import type { Store } from "./store";
import type { Pointer } from "./tools/pointer";
import type { Selection } from "./tools/selection";
import { COLOURINGS } from "./view/cloud";
import type { Sync } from "./view/sync";
import type { Viewer } from "./view/viewer";

const KEYS: [string, string][] = [
  ["Left drag", "turn the view (with the brush or lasso: choose points)"],
  ["Right drag, wheel", "move the view, zoom"],
  ["Shift, Alt with a tool", "choose points besides those chosen, choose these no longer"],
  ["Click, Shift+click", "choose a face, choose more"],
  ["1 2 3", "turn, brush, lasso"],
  ["V", "visible only / through"],
  ["[ ]", "smaller, larger brush"],
  ["+ −", "add chosen points to the edges, take them away"],
  ["M S G N Del", "merge, split off, give to face, give to none, delete"],
  ["Esc", "give up the lasso that is being drawn, choose nothing"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"],
  ["Enter", "do what the blue button says"],
  ["Page Up, Page Down", "step before, step after"],
  ["F, P", "fit, orthographic / perspective"],
  ["T, R, O", "from the top, the right, aslant"],
  ["C", "next colouring"],
  ["?", "this list"],
];

export function helpDialog(): HTMLDialogElement {
  const dialog = h("dialog", { class: "help-dialog" }, h("h2", {}, "Keyboard and mouse"), h("dl", { class: "keys" }, ...KEYS.flatMap(([key, text]) => [h("dt", {}, key), h("dd", {}, text)])), h("form", { method: "dialog" }, h("button", { class: "primary" }, "Close")));
  return dialog;
}

export function listen(store: Store, viewer: Viewer, sync: Sync, pointer: Pointer, selection: Selection, help: () => void): void {
  const press = (id: string) => document.getElementById(id)?.click();
  const go = (by: number) => store.goTo(STEPS[Math.min(Math.max(STEPS.indexOf(store.step) + by, 0), STEPS.length - 1)]!);
  const look = (view: string) => (viewer.cameras.look(view), viewer.draw());
  const colour = () => {
    const known = [...(document.getElementById("colouring") as HTMLSelectElement).options].filter((option) => !option.disabled).map((option) => option.value);
    const next = known[(known.indexOf(sync.colouring) + 1) % known.length];
    sync.choose(COLOURINGS.find((name) => name === next) ?? "plain");
    store.tell("selection");
  };
  const actions: Record<string, () => void> = {
    "1": () => pointer.use("turn"), "2": () => pointer.use("brush"), "3": () => pointer.use("lasso"),
    v: () => ((pointer.through = !pointer.through), store.tell("selection")),
    "[": () => (pointer.radius = Math.max(4, pointer.radius / 1.3)), "]": () => (pointer.radius = Math.min(120, pointer.radius * 1.3)),
    "+": () => press("boundary-add"), "-": () => press("boundary-drop"),
    m: () => press("face-merge"), s: () => press("face-split"), g: () => press("face-assign"), n: () => press("face-none"), Delete: () => press("face-delete"),
    Escape: () => pointer.abort() || (selection.clear(), store.choose(null, false)),
    Enter: () => press(store.step === "export" ? "export-step" : document.getElementById("compute") ? "compute" : "next"),
    PageUp: () => go(-1), PageDown: () => go(1),
    f: () => (viewer.cameras.fit(), viewer.draw()), p: () => press("camera"), t: () => look("Top"), r: () => look("Right"), o: () => look("Iso"), c: colour, "?": help,
  };
  window.addEventListener("keydown", (event) => {
    const dialog = document.querySelector<HTMLDialogElement>("dialog[open]");
    if (dialog) return event.key === "?" ? dialog.close() : undefined; // behind it nothing is done; Escape closes it by itself
    const field = event.target as HTMLElement;
    if (field.matches("input:not([type=range]):not([type=checkbox]), select, textarea")) return;
    if (event.ctrlKey || event.metaKey) {
      if (event.key.toLowerCase() !== "z" && event.key.toLowerCase() !== "y") return;
      event.preventDefault();
      store.send({ type: event.shiftKey || event.key.toLowerCase() === "y" ? "Redo" : "Undo" });
      return;
    }
    if (event.key === "Enter" && field.matches("button, summary, a")) return;
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (action) action();
  });
}
