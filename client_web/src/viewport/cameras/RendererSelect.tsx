/** The choice of who draws while a free camera moves: this browser or the server. */
import {
  setRenderer,
  rendererChoice,
  isClientRendering,
  TEXEL_SHADING_NOTE,
  tracesLobes,
  type RendererMode,
} from "../../session/clientRendering";
import { usesTexelShading } from "../../state/texelShading";

const BROWSER_TITLE =
  "This browser draws while the camera moves and loads no pictures. The server draws sharp shadows of the sun and of small " +
  "lights, contact lines and one-pixel highlights too; scenes with glass or cutouts are always the server's.";
const SERVER_TITLE = "The server draws while the camera moves and streams each picture.";
const CHOICES: Record<RendererMode, string> = { auto: "Automatic", client: "This browser", server: "Server" };

export function RendererSelect() {
  const serverTitle = usesTexelShading.value
    ? TEXEL_SHADING_NOTE
    : tracesLobes.value
      ? "The server draws while the camera moves, because polished materials are ray traced."
      : SERVER_TITLE;
  const title = isClientRendering.value ? BROWSER_TITLE : serverTitle;
  return (
    <label class="renderer-choice" title={title}>
      Renderer
      <select value={rendererChoice.value} onChange={(event) => setRenderer(event.currentTarget.value as RendererMode)}>
        {Object.entries(CHOICES).map(([value, label]) => (
          <option key={value} value={value}>
            {label}
          </option>
        ))}
      </select>
    </label>
  );
}
