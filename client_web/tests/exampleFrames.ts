import type { Frame } from "../src/session/net/binaryFrame";

/** A frame of one pixel, `at` from the left, whose encoded value is `at` too; of that revision. */
export function onePixel(view: string, complete: boolean, at = 0, width = 1): Frame {
  return {
    header: {
      frame: 1,
      revision: at,
      room_revision: 0,
      view,
      width,
      height: 1,
      tiles: [[at, 0, 1, 1]],
      format: "rgb9e5",
      exact: false,
      fidelity: "preview",
      complete,
      kind: "picture",
      alpha: false,
      camera_seq: null,
      free_camera_error: null,
      traces_lobes: false,
      scene_update: null,
      ms: { wait: 0, update: 0, encode: 0 },
    },
    payload: new Uint8Array(new Uint32Array([at]).buffer),
    alpha: null,
  };
}
