/** A form of a step's parameters, made of what the server says of them. */
import { fill, h, number } from "../dom";
import type { FormField, Step } from "../messages";
import type { Store } from "../store";

export class Form {
  readonly element = h("div", { class: "form" });
  private shown = "";

  constructor(
    private readonly store: Store,
    private readonly step: Step,
    private readonly without: string[] = [],
  ) {
    store.on(["state", "welcome", "frame"], () => this.update());
    store.on(["trouble"], () => ((this.shown = ""), this.update()));
    this.update();
  }

  private update(): void {
    const { welcome, state } = this.store;
    if (!welcome || !state) return;
    const matters = (field: FormField) => !state.idle.includes(`${field.stage}.${field.name}`);
    const fields = welcome.fields.filter((field) => field.step === this.step && !this.without.includes(field.name) && matters(field));
    const automatic = this.store.result(this.step)?.automatic ?? {};
    const key = JSON.stringify([fields.map((field) => [field.name, state.values[`${field.stage}.${field.name}`]]), automatic, state.unit, state.project, this.store.frames.get("cloud")?.header.numbers["h"]]);
    if (key === this.shown) return;
    this.shown = key;
    const open = this.element.querySelector("details")?.open ?? false;
    const [common, rest] = [fields.filter((field) => field.common), fields.filter((field) => !field.common)];
    const more = rest.length > 0 && h("details", { open }, h("summary", {}, `More parameters (${rest.length})`), ...rest.map((field) => this.row(field, automatic)));
    fill(this.element, ...common.map((field) => this.row(field, automatic)), more);
    if (more) more.append(...this.lengths(rest));
  }

  /** What lengths some of the numbers are counted in. */
  private lengths(fields: FormField[]): HTMLElement[] {
    const units = fields.map((field) => field.unit);
    const [spacing, unit] = [this.store.frames.get("cloud")?.header.numbers["h"], this.store.state!.unit];
    const about = [
      units.some((other) => other === "h" || other === "h²") && `h is the spacing of the points as far as noise lets it be told${spacing ? `, ${number(spacing)} ${unit} here` : ""}.`,
      units.includes("d̄") && "d̄ is the mean distance from a point to the nearest other one.",
    ].filter((text): text is string => !!text);
    return about.length ? [h("p", { class: "help lengths" }, about.join(" "))] : [];
  }

  private row(field: FormField, automatic: Record<string, unknown>): HTMLElement {
    const name = `${field.stage}.${field.name}`;
    const value = this.store.state!.values[name];
    const unit = field.unit === "unit" ? this.store.state!.unit : field.unit;
    const chosen = automatic[name];
    const isDefault = field.automatic ? value === null : JSON.stringify(value) === JSON.stringify(field.default);
    const reset = h("button", { class: "reset", title: field.automatic ? "Back to automatic" : "Back to the default", hidden: isDefault, onclick: () => this.set(field, null) }, "↺");
    const placeholder = field.automatic ? `automatic${chosen === undefined || chosen === null ? "" : `: ${typeof chosen === "number" ? number(chosen) : String(chosen)}`}` : "";
    const range = field.low === null ? "" : ` ${field.low} to ${field.high ?? "∞"}${unit ? ` ${unit}` : ""}.`;
    const control = this.control(field, value, placeholder, name);
    const text = h("label", { for: `field-${name}` }, field.label, unit ? h("span", { class: "dim" }, ` ${unit}`) : null);
    const more = h("button", { class: "info", title: field.help + range, "aria-label": `About ${field.label}`, onclick: () => row.classList.toggle("told") }, "i");
    const row = h("div", { class: "field", title: field.help + range }, h("div", { class: "line" }, text, control, reset, more), h("p", { class: "help" }, field.help + range));
    return row;
  }

  private control(field: FormField, value: unknown, placeholder: string, name: string): HTMLElement {
    const id = `field-${name}`;
    if (field.kind === "flag") {
      const box = h("input", { type: "checkbox", id, checked: value === true, onchange: () => this.set(field, box.checked) });
      return box;
    }
    if (field.kind === "choice") {
      const select = h("select", { id, onchange: () => this.set(field, select.value || null) });
      fill(select, field.automatic ? h("option", { value: "" }, placeholder) : null, ...field.choices.map((choice) => h("option", { value: choice }, choice)));
      select.value = typeof value === "string" ? value : "";
      return select;
    }
    if (field.kind === "choices") return this.choices(field, value);
    const numeric = field.kind !== "text";
    const input = h("input", { type: numeric ? "number" : "text", id, placeholder, step: field.kind === "integer" ? "1" : "any" });
    if (field.low !== null) input.min = String(field.low);
    if (field.high !== null) input.max = String(field.high);
    input.value = value === null || value === undefined ? "" : String(value);
    input.addEventListener("change", () => this.set(field, input.value === "" ? null : numeric ? Number(input.value) : input.value));
    return input;
  }

  private choices(field: FormField, value: unknown): HTMLElement {
    const on = Array.isArray(value) ? (value as string[]) : field.choices;
    const boxes = field.choices.map((choice) => {
      const box = h("input", { type: "checkbox", checked: on.includes(choice), onchange: () => change() });
      return { choice, box, label: h("label", {}, box, choice) };
    });
    const change = () => {
      const left = boxes.filter(({ box }) => box.checked).map(({ choice }) => choice);
      this.set(field, left.length === field.choices.length ? null : left);
    };
    return h("div", { class: "choices" }, ...boxes.map(({ label }) => label));
  }

  private set(field: FormField, value: unknown): void {
    this.store.send({ type: "Edit", edit: { set: { stage: field.stage, name: field.name, value } } });
  }
}
