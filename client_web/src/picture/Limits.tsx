/** In the picture's corner: what it leaves out; a click brings it back. */
import { limits } from "./limits";

export function Limits() {
  return (
    <div class="limits">
      {limits.value.map(({ words, title, lift }) => (
        <button key={words} title={title} onClick={lift}>
          {words} <span aria-hidden="true">×</span>
        </button>
      ))}
    </div>
  );
}
