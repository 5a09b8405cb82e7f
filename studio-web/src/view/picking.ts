/** Picking by a pass that draws integers: for each pixel which face, and how deep. */
import * as THREE from "three";

export class Picture {
  constructor(
    readonly width: number,
    readonly height: number,
    private readonly values: Uint32Array,
    private readonly depths: Float32Array,
  ) {}

  /** The face at a pixel, null where there is none; y counts from the top. */
  face(x: number, y: number): number | null {
    const k = this.index(x, y);
    return k < 0 || this.values[k] === 0 ? null : this.values[k]! - 1; // strays have no face
  }

  /** The depth of what is nearest at a pixel; infinite where there is nothing. */
  depth(x: number, y: number): number {
    const k = this.index(x, y);
    return k < 0 || this.values[k + 3] === 0 ? Infinity : this.depths[k + 1]!;
  }

  private index(x: number, y: number): number {
    const [column, row] = [Math.floor(x), this.height - 1 - Math.floor(y)];
    return column < 0 || row < 0 || column >= this.width || row >= this.height ? -1 : 4 * (row * this.width + column);
  }
}

export class Picker {
  private target: THREE.WebGLRenderTarget | null = null;

  constructor(private readonly renderer: THREE.WebGLRenderer) {}

  take(objects: THREE.Object3D[], camera: THREE.Camera, width: number, height: number): Picture {
    if (this.target?.width !== width || this.target.height !== height) {
      this.target?.dispose();
      this.target = new THREE.WebGLRenderTarget(width, height, {
        format: THREE.RGBAIntegerFormat,
        type: THREE.UnsignedIntType,
        internalFormat: "RGBA32UI",
        minFilter: THREE.NearestFilter,
        magFilter: THREE.NearestFilter,
      });
    }
    const scene = new THREE.Scene();
    const homes = objects.map((object) => object.parent);
    objects.forEach((object) => scene.add(object));
    const before = this.renderer.getClearColor(new THREE.Color());
    const beforeAlpha = this.renderer.getClearAlpha();
    this.renderer.setRenderTarget(this.target);
    this.renderer.setClearColor(0x000000, 0);
    this.renderer.clear();
    this.renderer.render(scene, camera);
    const values = new Uint32Array(4 * width * height);
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, values);
    this.renderer.setRenderTarget(null);
    this.renderer.setClearColor(before, beforeAlpha);
    objects.forEach((object, k) => homes[k]?.add(object));
    return new Picture(width, height, values, new Float32Array(values.buffer));
  }
}
