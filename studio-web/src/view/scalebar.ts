/** A bar of a round length, with its unit. */
import { h, number, write } from "../dom";

export class ScaleBar {
  private readonly bar = h("span", { class: "bar" });
  private readonly text = h("span", {});
  readonly element = h("div", { class: "scalebar", title: "Length on the plane through the middle" }, this.bar, this.text);

  update(pixels: number, unit: string): void {
    this.element.hidden = !(pixels > 0) || !Number.isFinite(pixels);
    if (this.element.hidden) return;
    const most = 150 / pixels;
    const power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((factor) => factor * power).find((value) => value <= most) ?? power;
    this.bar.style.width = `${length * pixels}px`;
    write(this.text, `${number(length)} ${unit}`);
  }
}
