/** How many points are drawn while something moves: as many as leave 30 frames a second, however slow the machine draws. */
const FEWEST = 3_000;
const SLOW = 30;
const FAST = 20;

export class Pace {
  private smooth = 0;

  constructor(public points: number) {}

  /** Learn how many milliseconds lie between two frames of a movement. */
  took(milliseconds: number, most: number): void {
    this.smooth = this.smooth > 0 ? 0.75 * this.smooth + 0.25 * milliseconds : milliseconds;
    if (milliseconds > 3 * SLOW) this.change(0.3, most); // far too many: no waiting for the next frames
    else if (this.smooth > SLOW) this.change(0.9, most);
    else if (this.smooth < FAST) this.change(1.1, most);
  }

  private change(factor: number, most: number): void {
    this.points = Math.round(Math.min(Math.max(this.points * factor, FEWEST), Math.max(most, FEWEST)));
    if (factor < 0.5) this.smooth = 0;
  }
}
