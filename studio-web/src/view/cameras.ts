/** One point of view through two cameras: perspective and orthographic show the same place at the same size. */
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const FIELD = 35;
export const VIEWS: Record<string, [number, number, number]> = {
  Iso: [1, -1.2, 0.9],
  Top: [0, 0, 1],
  Bottom: [0, 0, -1],
  Front: [0, -1, 0],
  Back: [0, 1, 0],
  Left: [-1, 0, 0],
  Right: [1, 0, 0],
};

export class Cameras {
  readonly perspective = new THREE.PerspectiveCamera(FIELD, 1, 0.1, 1000);
  readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 1000);
  readonly controls: OrbitControls;
  isPerspective = false;
  private width = 1;
  private height = 1;
  private readonly centre = new THREE.Vector3();
  private radius = 1;

  constructor(canvas: HTMLCanvasElement, moved: () => void) {
    for (const camera of [this.perspective, this.orthographic]) {
      camera.up.set(0, 0, 1);
      camera.position.set(1, -1, 1);
    }
    this.controls = new OrbitControls(this.orthographic, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", moved);
  }

  get current(): THREE.PerspectiveCamera | THREE.OrthographicCamera {
    return this.isPerspective ? this.perspective : this.orthographic;
  }

  /** Pixels of one unit: everywhere in orthographic, at distance one in perspective. */
  get pixels(): number {
    if (this.isPerspective) return this.height / (2 * Math.tan(THREE.MathUtils.degToRad(FIELD) / 2));
    return (this.height * this.orthographic.zoom) / (this.orthographic.top - this.orthographic.bottom);
  }

  /** Pixels of one unit at the place that is turned about. */
  get pixelsAtTarget(): number {
    return this.isPerspective ? this.pixels / this.perspective.position.distanceTo(this.controls.target) : this.pixels;
  }

  resize(width: number, height: number): void {
    [this.width, this.height] = [width, height];
    this.perspective.aspect = width / height;
    this.shape();
  }

  about(box: THREE.Box3): void {
    box.getCenter(this.centre);
    this.radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 1e-12);
    this.look("Iso");
  }

  look(view: string): void {
    const direction = new THREE.Vector3(...(VIEWS[view] ?? VIEWS["Iso"]!)).normalize();
    this.place(direction);
  }

  fit(): void {
    this.place(this.current.position.clone().sub(this.controls.target).normalize());
  }

  toggle(): void {
    const scale = this.pixelsAtTarget;
    const from = this.current;
    const direction = from.position.clone().sub(this.controls.target).normalize();
    this.isPerspective = !this.isPerspective;
    const distance = this.isPerspective ? this.pixels / scale : 4 * this.radius;
    this.current.position.copy(this.controls.target).addScaledVector(direction, distance);
    if (!this.isPerspective) {
      this.shape();
      this.orthographic.zoom = (scale * (this.orthographic.top - this.orthographic.bottom)) / this.height;
    }
    this.controls.object = this.current;
    this.shape();
    this.controls.update();
  }

  private place(direction: THREE.Vector3): void {
    this.controls.target.copy(this.centre);
    const narrow = Math.min(1, this.width / this.height);
    const distance = this.isPerspective ? (1.08 * this.radius) / Math.sin(THREE.MathUtils.degToRad(FIELD) / 2) / narrow : 4 * this.radius;
    this.current.position.copy(this.centre).addScaledVector(direction, distance);
    this.orthographic.zoom = 1;
    this.shape();
    this.controls.update();
  }

  private shape(): void {
    const aspect = this.width / this.height;
    const half = (1.08 * this.radius) / Math.min(1, aspect);
    Object.assign(this.orthographic, { left: -half * aspect, right: half * aspect, top: half, bottom: -half, near: -20 * this.radius, far: 40 * this.radius });
    const distance = this.perspective.position.distanceTo(this.centre);
    this.perspective.near = Math.max(distance - 3 * this.radius, 0.005 * this.radius);
    this.perspective.far = distance + 3 * this.radius;
    this.perspective.updateProjectionMatrix();
    this.orthographic.updateProjectionMatrix();
  }

  /** Keep the near and far planes about the part. */
  settle(): void {
    this.shape();
  }
}
