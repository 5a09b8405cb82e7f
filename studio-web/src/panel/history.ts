/** What was done, in its order; what was undone stands behind it until something else is done. */
import { fill, h } from "../dom";
import type { Store } from "../store";

export function historyPanel(store: Store): HTMLElement {
  const list = h("ol", { class: "edits" });
  const title = h("summary", {});
  const update = () => {
    const edits = store.state?.edits ?? [];
    title.textContent = `Done by hand (${edits.filter((edit) => edit.done).length})`;
    fill(list, ...(edits.length ? edits.map((edit) => h("li", { class: edit.done ? "" : "undone", title: edit.done ? "" : "Undone" }, edit.text)) : [h("li", { class: "dim" }, "Nothing yet. All that you change is kept at once, and can be undone.")]));
    list.scrollTop = list.scrollHeight;
  };
  store.on(["state"], update);
  update();
  return h("details", { class: "history", open: true }, title, list);
}
