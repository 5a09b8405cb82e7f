/** What needs to be seen at once: progress, troubles, a server that is gone, a studio without a scan. */
import { fill, h, write } from "../dom";
import type { Store } from "../store";

export function progressBar(store: Store): HTMLElement {
  const bar = h("div", { class: "fill" });
  const text = h("span", {});
  const stop = h("button", { id: "stop", onclick: () => store.stop() }, "Stop");
  const element = h("div", { class: "progress", role: "status", hidden: true }, h("div", { class: "track" }, bar), text, stop);
  const update = () => {
    const { progress, state } = store;
    element.hidden = !state?.running && !store.stopped;
    if (!state?.running) store.progress = null;
    stop.hidden = store.stopping || store.stopped;
    bar.parentElement!.hidden = store.stopped;
    const share = progress && progress.total > 0 ? progress.done / progress.total : 0;
    bar.style.width = `${Math.round(100 * share)}%`;
    const counted = progress !== null && progress.total > 0 && !store.stopping;
    bar.parentElement!.classList.toggle("uncounted", !counted);
    text.textContent = store.stopped ? "Stopped. What was done before is kept." : counted ? `${progress.stage}, ${Math.round(100 * share)} %` : `${store.stopping ? "stopping" : (progress?.stage ?? "starting")} …`;
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
    const project = store.state?.project;
    fill(element, store.online.why, project ? h("span", {}, " The project is ", h("code", {}, project), ".") : null);
  });
  return element;
}

/** What should be known all the time. */
export function noticeLine(store: Store): HTMLElement {
  const element = h("div", { class: "notice", role: "status", hidden: true });
  store.on(["state"], () => {
    element.hidden = !store.state?.notice;
    write(element, store.state?.notice ?? "");
  });
  return element;
}

/** Without a project: where to drop a scan. */
export function welcomePanel(store: Store, toasts: Toasts): HTMLElement {
  const input = h("input", { type: "file", id: "scan-file" });
  const text = h("p", {});
  const zone = h("div", { class: "drop", hidden: true }, h("h2", {}, "Open a scan"), h("p", {}, "Drop the file of a scan here, or choose one: PLY, PCD, XYZ, LAS, E57, STL, OBJ, …"), input, text, h("p", { class: "help" }, "It is copied into a project folder, where the studio was started. To go on with a project, or to work beside the scan: ", h("code", {}, "scan2nurbs studio SCAN-OR-PROJECT")));
  const upload = async (file: File) => {
    text.textContent = `Reading ${file.name} …`;
    input.disabled = true;
    const answer = await fetch(`scan?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file }).catch(() => null);
    input.disabled = false;
    input.value = ""; // the same file may be chosen again once it was mended
    text.textContent = "";
    if (!answer?.ok) toasts.show(answer ? await answer.text() : "The scan could not be sent to the studio.");
  };
  input.addEventListener("change", () => input.files?.[0] && void upload(input.files[0]));
  // Anywhere on the page: a browser would leave the page for a file that is dropped beside.
  window.addEventListener("dragover", (event) => event.preventDefault());
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    const file = event.dataTransfer?.files[0];
    if (!file || input.disabled) return;
    if (store.state?.opens) void upload(file);
    else toasts.show("A scan is open already. Start another studio for another scan.");
  });
  store.on(["state"], () => {
    const { state } = store;
    zone.hidden = !state?.opens;
    const trouble = state?.steps.find((entry) => entry.trouble)?.trouble;
    if (trouble && state.opens) fill(text, h("span", { class: "trouble" }, `${trouble} Choose another file.`));
    else if (state?.project) fill(text, "");
  });
  return zone;
}
