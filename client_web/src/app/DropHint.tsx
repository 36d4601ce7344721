/** Shown while files are dragged over the page: where each type goes. */
import { hoveredMaterial } from "../state/selection";

export function DropHint() {
  const material = hoveredMaterial.value;
  return (
    <div class="drop-hint">
      <dl>
        <dt>Images, texture folders</dt>
        <dd>{material === null ? "drop on an object" : `apply to “${material}”`}</dd>
        <dt>HDRI (.hdr, .exr)</dt>
        <dd>light the scene</dd>
        <dt>Materials (.mtlx, .binary, .btf)</dt>
        <dd>add to the Library</dd>
      </dl>
    </div>
  );
}
