/** What colours mean, with numbers. */
import { fill, h, number } from "../dom";
import { css, rampColour } from "./colours";

export class Legend {
  readonly element = h("div", { class: "legend" });

  hide(): void {
    this.element.hidden = true;
  }

  ramp(title: string, ramp: string, low: number, high: number, unit: string, mark?: number): void {
    const canvas = h("canvas", { width: 200, height: 12 });
    const pen = canvas.getContext("2d")!;
    for (let x = 0; x < 200; x++) {
      const value = low + ((high - low) * x) / 199;
      pen.fillStyle = mark !== undefined && value <= mark ? "#738799" : css(rampColour(ramp, x / 199));
      pen.fillRect(x, 0, 1, 12);
    }
    const ticks = [low, (low + high) / 2, high].map((value) => h("span", {}, number(value)));
    this.put(h("b", {}, title + (unit ? ` (${unit})` : "")), canvas, h("div", { class: "ticks" }, ...ticks));
  }

  faces(entries: { name: string; colour: readonly number[] }[]): void {
    const shown = entries.slice(0, 8).map((entry) => {
      const swatch = h("i", { class: "swatch" });
      swatch.style.background = css(entry.colour.map((c) => Math.round(255 * c)));
      return h("div", {}, swatch, entry.name);
    });
    const more = entries.length > 8 ? h("div", { class: "dim" }, `and ${entries.length - 8} more`) : null;
    this.put(h("b", {}, "Faces"), h("div", { class: "swatches" }, ...shown), more);
  }

  private put(...children: (Node | null)[]): void {
    this.element.hidden = false;
    fill(this.element, ...children);
  }
}
