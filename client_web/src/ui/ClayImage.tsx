/** A clay picture from the server; the previous one stays until the next has loaded. */
import { useState } from "preact/hooks";
import { serverUrl } from "../session/net/serverUrl";

interface ClayImageProps {
  url: string;
  /** Text for screen readers; empty: decoration. */
  label: string;
  isLazy?: boolean;
  /** Called when the picture, or an error, has arrived. */
  onSettled?: () => void;
}

export function ClayImage({ url, label, isLazy = false, onSettled }: ClayImageProps) {
  const [loaded, setLoaded] = useState({ url: "", isFailed: false });
  const settle = (isFailed: boolean) => {
    setLoaded({ url, isFailed });
    onSettled?.();
  };
  if (loaded.url === url && loaded.isFailed) return <span class="no-picture">No clay picture available</span>;
  return (
    <img
      class={`clay ${loaded.url === url ? "" : "is-loading"}`}
      src={serverUrl(url)}
      alt={label}
      loading={isLazy ? "lazy" : "eager"}
      onLoad={() => settle(false)}
      onError={() => settle(true)}
    />
  );
}
