"""What the module Stereo SOM does, apart from Qt: it needs MRML nodes, and no application.

`settings` and `packages` may be imported before anything is installed; the others need
`stereosom`.
"""
