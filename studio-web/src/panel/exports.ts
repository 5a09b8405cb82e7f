/** What can be taken away, and what has been written. */
import { fill, h } from "../dom";
import type { Store } from "../store";

export function exportPanel(store: Store): HTMLElement {
  const element = h("div", {});
  const update = () => {
    const files = store.state?.files ?? [];
    const busy = store.state?.running !== null;
    const kinds = (store.welcome?.exports ?? []).map((kind) =>
      h("button", { class: kind.name === "step" ? "primary wide" : "wide", id: `export-${kind.name}`, disabled: !kind.available || busy, title: kind.name === "step" ? "Write this file (Enter)" : null, onclick: () => store.send({ type: "Export", kind: kind.name }) }, kind.text),
    );
    const written = files.map((file) =>
      h(
        "div",
        { class: "file" },
        h("a", { href: `files/${encodeURIComponent(file.name)}`, download: file.name, class: "download" }, file.name),
        h("span", { class: "dim" }, size(file.size)),
        !file.current && h("span", { class: "old", title: "Something was changed since: export it again" }, "not up to date"),
      ),
    );
    fill(
      element,
      h("div", { class: "buttons column" }, ...kinds),
      h("h3", {}, "Files"),
      ...(written.length ? written : [h("p", { class: "help" }, "Nothing is written yet. Choose a format above; the file then stands here to be downloaded.")]),
      h("p", { class: "help" }, "The command line makes the same STEP file: ", h("code", {}, `scan2nurbs convert --project ${quoted(store.state?.project ?? "DIR")} -o part.step`)),
    );
  };
  store.on(["state", "welcome", "step"], update);
  update();
  return element;
}

/** A word as a shell reads it. */
function quoted(word: string): string {
  return /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'\\''`)}'`;
}

function size(bytes: number): string {
  return bytes > 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.max(1, Math.round(bytes / 1e3))} kB`;
}
