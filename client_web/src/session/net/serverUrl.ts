/** A path of the server as an address relative to the page: the server may be below a prefix that only browsers know. */
export const serverUrl = (path: string): string => path.replace(/^\//, "./");
