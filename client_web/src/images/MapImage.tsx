/** The image in the place of one of a material's maps: choose one, send one, drop one here, take it off. */
import { ImageChoice, type Choice } from "./ImageChoice";
import { letGoOver } from "./taking";

export function MapImage(props: Choice) {
  const { label, title, material, put } = props;
  return (
    <div class="map-image" onDrop={() => letGoOver(Promise.resolve(material), put)}>
      <span class="param-label">{label}</span>
      <ImageChoice {...props} title={`${title} An image file can be dropped here, too.`} />
    </div>
  );
}
