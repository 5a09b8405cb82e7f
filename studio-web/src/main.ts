/** Put the page together. */
import "./style.css";
import { Connection } from "./connection";
import { h } from "./dom";
import { helpDialog, listen } from "./keys";
import { topBar } from "./panel/bar";
import { boundaryPanel, facesPanel } from "./panel/corrections";
import { exportPanel } from "./panel/exports";
import { facesList } from "./panel/faces";
import { Form } from "./panel/form";
import { historyPanel } from "./panel/history";
import { layersPanel } from "./panel/layers";
import { noticeLine, offline, progressBar, Toasts, welcomePanel } from "./panel/notices";
import { stepsPanel } from "./panel/steps";
import { thresholdPanel } from "./panel/threshold";
import { Store } from "./store";
import { Pointer } from "./tools/pointer";
import { Selection } from "./tools/selection";
import { toolbar } from "./tools/toolbar";
import { Legend } from "./view/legend";
import { ScaleBar } from "./view/scalebar";
import { Sync } from "./view/sync";
import { Viewer } from "./view/viewer";

const store = new Store();
const stage = h("main", { class: "stage" });
const viewer = new Viewer(stage);
const legend = new Legend();
const scalebar = new ScaleBar();
const sync = new Sync(store, viewer, legend);
const selection = new Selection(store, viewer, sync);
const pointer = new Pointer(store, viewer, selection, stage);
const toasts = new Toasts();
const dialog = helpDialog();
const help = () => dialog.showModal();

const faces = facesList(store);
const side = stepsPanel(store, {
  scan: [new Form(store, "scan").element],
  edges: [thresholdPanel(store, sync), new Form(store, "edges", ["threshold"]).element, boundaryPanel(store, selection, pointer)],
  faces: [facesPanel(store, selection, pointer), faces, new Form(store, "faces").element],
  surfaces: [new Form(store, "surfaces").element],
  model: [new Form(store, "model").element],
  export: [exportPanel(store)],
}, { surfaces: [faces], model: [faces] });
stage.append(
  h("div", { class: "above" }, toolbar(store, viewer, sync, pointer), h("div", { class: "right" }, layersPanel(store, viewer), historyPanel(store))),
  h("div", { class: "bottom" }, scalebar.element, progressBar(store), legend.element),
  welcomePanel(store, toasts),
  toasts.element,
  offline(store),
);
legend.hide();
document.getElementById("app")!.append(topBar(store, help), noticeLine(store), h("div", { class: "columns" }, side, stage), dialog);
viewer.onDrawn = () => scalebar.update(viewer.cloud ? viewer.cameras.pixelsAtTarget : 0, store.state?.unit ?? "");
listen(store, viewer, sync, pointer, selection, help);

let bytes = 0;
let found = false;
const connection = new Connection({
  message(message) {
    if (message.type === "Welcome") {
      store.welcome = message;
      store.tell("welcome");
    } else if (message.type === "State") {
      const before = store.state;
      store.state = message;
      if (!message.running && store.stopping) store.hasStopped();
      if (message.running) store.stopped = false;
      if (!found && message.project) {
        found = true;
        store.goTo(remembered() ?? message.reached);
      }
      const numbers = store.entries().map((entry) => entry.number);
      if (store.faces.some((face) => !numbers.includes(face)) && numbers.length) store.faces = store.faces.filter((face) => numbers.includes(face));
      store.tell("state");
      for (const step of message.steps) {
        const trouble = before?.steps.find((other) => other.step === step.step)?.trouble;
        if (step.trouble && step.trouble !== trouble && step.step !== store.step) toasts.show(step.trouble);
      }
    } else if (message.type === "Progress") {
      store.progress = message;
      store.tell("progress");
    } else {
      toasts.show(message.text);
      store.tell("trouble"); // a form may show what was refused
    }
  },
  frame(frame) {
    bytes += frame.bytes;
    store.frames.set(frame.header.name, frame);
    store.lastFrame = frame.header.name;
    store.tell("frame");
  },
  online(yes, why) {
    store.online = { yes, why };
    store.tell("online");
  },
});
store.send = (message) => connection.send(message);
store.on(["step"], () => sessionStorage.setItem("step", store.step));

function remembered(): typeof store.step | null {
  const step = sessionStorage.getItem("step");
  return store.state?.steps.find((entry) => entry.step === step)?.step ?? null;
}

/** For measurements and tests. */
Object.assign(window, { studio: { store, viewer, sync, selection, bytes: () => bytes } });
void connection.open();
