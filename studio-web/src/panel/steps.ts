/** The six steps at the side: where one is, what to do, what came out. */
import { fill, h } from "../dom";
import { STEPS, type Step, type StepResult } from "../messages";
import type { Store } from "../store";

interface About {
  title: string;
  text: string;
  action: string;
}

export const ABOUT: Record<Step, About> = {
  scan: { title: "Scan", text: "These are the points as they were read. Check extent and unit: a wrong unit makes a part of the wrong size.", action: "Measure the scan" },
  edges: { title: "Edges", text: "Points where the surface turns sharply. They make the curves that are drawn here and over the faces, and the column “edge” of labelled points. Move the threshold until the edges stand out, and nothing else. Faces are found from the bends of the surface, and corrected in their own step; these marks bear only on borders within freeform surfaces.", action: "Find edges" },
  faces: { title: "Faces", text: "Points in groups, each explained by one surface. Merge what belongs together, split what does not.", action: "Find faces" },
  surfaces: { title: "Surfaces", text: "A surface for each face, and the borders along which they meet, red where the scan ends. Points are coloured by their distance from their surface.", action: "Fit surfaces" },
  model: { title: "Model", text: "Faces trimmed along shared edges and sewn into one body, checked by the CAD kernel. Red edges are open: no other face meets there.", action: "Build the model" },
  export: { title: "Export", text: "Take the model away as a file.", action: "" },
};

/** `bodies` stand before a step's figures, `lists` behind them. */
export function stepsPanel(store: Store, bodies: Record<Step, HTMLElement[]>, lists: Partial<Record<Step, HTMLElement[]>>): HTMLElement {
  const list = h("nav", { class: "steps", "aria-label": "Steps" });
  const head = h("div", {});
  const alarm = h("div", {});
  const foot = h("div", { class: "outcome" });
  const body = h("div", { class: "step-body" });
  const rest = h("div", {});
  const next = h("div", { class: "next" });

  let offered = "";
  /** Say what is next; a button that stays is left alone, since one that is replaced while it is pressed is not clicked. */
  function offer(): void {
    const { state, step, stopping } = store;
    const key = JSON.stringify([step, stopping, state?.running, state?.project, state?.steps.map((entry) => [entry.status, entry.result !== null])]);
    if (key === offered) return;
    offered = key;
    fill(next, ...buttons(store));
  }

  function update(): void {
    const states = store.state?.steps ?? [];
    fill(
      list,
      ...STEPS.map((step, k) => {
        const status = store.status(step);
        const seconds = store.result(step)?.seconds;
        const title = `${ABOUT[step].title}: ${WORDS[status] ?? status}${seconds ? `, ${time(seconds)}` : ""}`;
        return h("button", { class: `step ${status}`, id: `step-${step}`, title, "aria-current": step === store.step ? "step" : undefined, onclick: () => store.goTo(step) }, h("span", { class: "dot" }, String(k + 1)), ABOUT[step].title);
      }),
    );
    const state = states.find((entry) => entry.step === store.step);
    const opened = !store.state || store.state.project !== "";
    fill(head, h("h2", {}, ABOUT[store.step].title), h("p", { class: "help lead" }, opened ? ABOUT[store.step].text : "There is no scan yet. Drop its file on the right; the steps above then lead from its points to a CAD model."));
    fill(alarm, ...troubles(store));
    fill(foot, ...(state?.result ? outcome(state.result) : []));
    offer();
    body.hidden = foot.hidden = rest.hidden = !opened;
  }

  store.on(["state", "step"], update);
  store.on(["progress"], offer);
  const place = () => (fill(body, ...bodies[store.step]), fill(rest, ...(lists[store.step] ?? [])));
  store.on(["step"], place);
  place();
  update();
  return h("aside", { class: "side" }, list, h("div", { class: "scroll" }, head, next, alarm, body, foot, rest));
}

const WORDS: Record<string, string> = { empty: "not done yet", current: "done", outdated: "to be done again", running: "at work", failed: "failed" };

/** What stands in the way of this step: its own trouble, or that of a step that it needs. */
function troubles(store: Store): HTMLElement[] {
  const upTo = STEPS.indexOf(store.step);
  const failed = store.state?.steps.find((entry) => entry.trouble && STEPS.indexOf(entry.step) <= upTo);
  if (!failed) return [];
  const there = failed.step === store.step;
  const where = there ? null : h("button", { onclick: () => store.goTo(failed.step) }, `Go to ${ABOUT[failed.step].title}`);
  const undo = store.state!.can_undo ? h("button", { onclick: () => store.send({ type: "Undo" }) }, "Undo the last change") : null;
  return [h("div", { class: "trouble", role: "alert" }, h("p", {}, there ? "" : `${ABOUT[failed.step].title}: `, failed.trouble), h("div", { class: "buttons" }, where, undo))];
}

function outcome(result: StepResult): HTMLElement[] {
  const parts: HTMLElement[] = [];
  const rows = [...result.figures, { label: "Time", value: time(result.seconds) }];
  parts.push(h("h3", {}, "Figures"), h("dl", { class: "figures" }, ...rows.flatMap((row) => [h("dt", {}, row.label), h("dd", {}, row.value)])));
  if (result.warnings.length) parts.push(h("h3", {}, "Warnings"), ...result.warnings.map((text) => h("p", { class: "warning" }, text)));
  return parts;
}

/** What to do next: compute this step, or go on. */
function buttons(store: Store): HTMLElement[] {
  const { step, state } = store;
  if (!state?.project) return [];
  const status = store.status(step);
  const place = STEPS.indexOf(step);
  if (step === "export") {
    if (store.status("model") === "current") return [];
    return [h("p", { class: "help" }, store.result("model") ? "The model is not up to date; exporting builds it again first." : "There is no model yet; exporting builds it first, with all that it needs.")];
  }
  const onTheWay = status !== "current" && state.running !== null && STEPS.indexOf(state.running) >= place; // to this step, or beyond
  if (onTheWay) return [h("button", { class: "wide", id: "cancel", disabled: store.stopping, onclick: () => store.stop() }, store.stopping ? "Stopping …" : "Stop")];
  if (status !== "current") {
    const again = status === "empty" ? ABOUT[step].action : `${ABOUT[step].action} again`;
    return [h("button", { class: "primary wide", id: "compute", disabled: state.running !== null, title: "Compute this step and what it needs (Enter)", onclick: () => store.send({ type: "Compute", until: step }) }, again)];
  }
  const following = STEPS[place + 1]!;
  return [
    h(
      "button",
      {
        class: "primary wide",
        id: "next",
        title: "Go on (Enter)",
        onclick: () => {
          if (following !== "export" && store.status(following) === "empty") store.send({ type: "Compute", until: following });
          store.goTo(following);
        },
      },
      `Next: ${following === "export" ? "take the model away" : ABOUT[following].action.toLowerCase()}`,
    ),
  ];
}

export function time(seconds: number): string {
  return seconds < 0.095 ? `${Math.round(seconds * 1000)} ms` : seconds < 90 ? `${seconds.toFixed(1)} s` : `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}
