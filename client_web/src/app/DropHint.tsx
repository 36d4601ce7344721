/** While files are held over the page: what becomes of which. */
import { hoveredMaterial } from "../state/selection";

export function DropHint() {
  const material = hoveredMaterial.value;
  return (
    <div class="drop-hint">
      <dl>
        <dt>Images, texture folders</dt>
        <dd>{material === null ? "drop them on an object" : `onto “${material}”`}</dd>
        <dt>HDRI (.hdr, .exr)</dt>
        <dd>lights the scene</dd>
        <dt>Measured (.binary, .btf)</dt>
        <dd>into the Library</dd>
      </dl>
    </div>
  );
}
