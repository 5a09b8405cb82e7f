/** What colours mean, with numbers. */
import { fill, h, number } from "../dom";
import { css, rampColour } from "./colours";

const GREY = [115, 135, 153];

interface Entry {
  name: string;
  colour: readonly number[];
}

export class Legend {
  readonly element = h("div", { class: "legend" });
  private readonly canvas = h("canvas", { width: 200, height: 1 });
  private shown = "";

  hide(): void {
    this.shown = "";
    this.element.hidden = true;
  }

  ramp(title: string, ramp: string, low: number, high: number, unit: string, mark?: number, others: Entry[] = []): void {
    const picture = new ImageData(200, 1);
    for (let x = 0; x < 200; x++) {
      const value = low + ((high - low) * x) / 199;
      picture.data.set([...(mark !== undefined && value <= mark ? GREY : rampColour(ramp, x / 199)), 255], 4 * x);
    }
    this.canvas.getContext("2d")!.putImageData(picture, 0, 0);
    const key = JSON.stringify([title, low, high, unit, others]);
    if (this.shown === key) return; // while a slider moves, only the picture changes
    const ticks = [low, (low + high) / 2, high].map((value) => h("span", {}, tick(value, high - low)));
    const more = others.length ? h("div", { class: "swatches" }, ...others.map(swatch)) : null;
    this.put(key, h("b", {}, title + (unit ? ` (${unit})` : "")), this.canvas, h("div", { class: "ticks" }, ...ticks), more);
  }

  faces(entries: Entry[]): void {
    const shown = entries.slice(0, 8).map(swatch);
    const more = entries.length > 8 ? h("div", { class: "dim" }, `and ${entries.length - 8} more`) : null;
    this.put("faces", h("b", {}, "Faces"), h("div", { class: "swatches" }, ...shown), more);
  }

  private put(key: string, ...children: (Node | null)[]): void {
    this.shown = key;
    this.element.hidden = false;
    fill(this.element, ...children);
  }
}

function swatch(entry: Entry): HTMLElement {
  const colour = h("i", { class: "swatch" });
  colour.style.background = css(entry.colour.map((c) => Math.round(255 * c)));
  return h("div", {}, colour, entry.name);
}

/** A number with as many digits as tell the ends of its range apart, also far from the origin. */
function tick(value: number, span: number): string {
  if (!(span > 0) || Math.abs(value) < 20 * span) return number(value);
  return value.toFixed(Math.min(Math.max(2 - Math.floor(Math.log10(span)), 0), 9));
}
