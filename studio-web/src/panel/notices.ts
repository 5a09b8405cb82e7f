/** What needs to be seen at once: progress, troubles, a server that is gone, a studio without a scan. */
import { fill, h } from "../dom";
import type { Store } from "../store";

export function progressBar(store: Store): HTMLElement {
  const bar = h("div", { class: "fill" });
  const text = h("span", {});
  const stop = h("button", { onclick: () => store.send({ type: "Cancel" }) }, "Stop");
  const element = h("div", { class: "progress", role: "status", hidden: true }, h("div", { class: "track" }, bar), text, stop);
  const update = () => {
    const { progress, state } = store;
    element.hidden = !state?.running;
    if (!state?.running) store.progress = null;
    const share = progress && progress.total > 0 ? progress.done / progress.total : 0;
    bar.style.width = `${Math.round(100 * share)}%`;
    text.textContent = progress ? `${progress.stage}, ${Math.round(100 * share)} %` : "starting";
  };
  store.on(["state", "progress"], update);
  return element;
}

export class Toasts {
  readonly element = h("div", { class: "toasts", role: "alert" });

  show(text: string): void {
    const toast = h("div", { class: "toast" }, text, h("button", { "aria-label": "Close", onclick: () => toast.remove() }, "×"));
    this.element.append(toast);
    setTimeout(() => toast.remove(), 12_000);
  }
}

export function offline(store: Store): HTMLElement {
  const element = h("div", { class: "offline", role: "alert", hidden: true });
  store.on(["online"], () => {
    element.hidden = store.online.yes;
    fill(element, store.online.why);
  });
  return element;
}

/** Without a project: where to drop a scan. */
export function welcomePanel(store: Store, toasts: Toasts): HTMLElement {
  const input = h("input", { type: "file", id: "scan-file" });
  const text = h("p", {});
  const zone = h("div", { class: "drop", hidden: true }, h("h2", {}, "Open a scan"), h("p", {}, "Drop the file of a scan here, or choose one: PLY, PCD, XYZ, LAS, E57, STL, OBJ, …"), input, text, h("p", { class: "help" }, "Or start the studio with it: ", h("code", {}, "scan2nurbs studio SCAN")));
  const upload = async (file: File) => {
    text.textContent = `Reading ${file.name} …`;
    const answer = await fetch(`scan?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file }).catch(() => null);
    text.textContent = "";
    if (!answer?.ok) toasts.show(answer ? await answer.text() : "The scan could not be sent to the studio.");
  };
  input.addEventListener("change", () => input.files?.[0] && void upload(input.files[0]));
  zone.addEventListener("dragover", (event) => event.preventDefault());
  zone.addEventListener("drop", (event) => {
    event.preventDefault();
    const file = event.dataTransfer?.files[0];
    if (file) void upload(file);
  });
  store.on(["state"], () => (zone.hidden = !store.state || store.state.project !== ""));
  return zone;
}
