/** The faces as a list, with type, size and deviation. */
import { count, fill, h, number } from "../dom";
import type { FaceEntry } from "../messages";
import type { Store } from "../store";
import { css } from "../view/colours";

export function facesList(store: Store): HTMLElement {
  const list = h("div", { class: "faces", role: "listbox", "aria-label": "Faces" });
  const said = h("p", { class: "help" });
  const update = () => {
    const unit = store.state?.unit ?? "";
    const rows = store.entries().map((entry) => {
      const on = store.faces.includes(entry.number);
      const swatch = h("i", { class: "swatch" });
      swatch.style.background = css(entry.colour.map((c) => Math.round(255 * c)));
      const off = entry.rms === null ? "" : `±${number(entry.rms, 2)} ${unit}`;
      const title = [about(entry, unit), entry.largest === null ? "" : `largest deviation ${number(entry.largest)} ${unit}`, ...entry.notes].filter(Boolean).join("\n");
      return h(
        "button",
        { class: "face", role: "option", "aria-selected": String(on), title, onclick: ((event: MouseEvent) => store.choose(entry.number, event.shiftKey || event.ctrlKey)) as unknown },
        swatch,
        h("span", {}, entry.name, entry.notes.length ? h("span", { class: "warning" }, " ⚠") : null),
        h("span", { class: "dim" }, count(entry.n_points)),
        h("span", { class: "dim" }, off),
      );
    });
    const heads = ["", "Face", "Points", `Deviation, rms`].map((text) => h("span", {}, text));
    const top = list.scrollTop;
    fill(list, ...(rows.length ? [h("div", { class: "face heads dim", "aria-hidden": "true" }, ...heads), ...rows] : []));
    const chosen = store.entries().find((entry) => entry.number === store.faces[0]);
    const known = chosen && store.faces.length === 1 ? about(chosen, unit) : "";
    list.scrollTop = top;
    fill(said, known ? `${chosen!.name}: ${[known, ...chosen!.notes].join("; ")}` : "");
  };
  store.on(["state", "faces", "step", "frame"], update);
  store.on(["faces"], () => list.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" }));
  update();
  return h("div", {}, list, said);
}

/** What is known of a face's surface, and what was asked for. */
function about(entry: FaceEntry, unit: string): string {
  const net = entry.n_control_points === null ? "" : `${count(entry.n_control_points)} control points`;
  const tolerance = entry.tolerance === null ? "" : `tolerance ${number(entry.tolerance)} ${unit}`;
  return [entry.parameters, net, tolerance].filter(Boolean).join("; ");
}
