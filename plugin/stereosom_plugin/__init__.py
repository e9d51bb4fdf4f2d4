"""What stands around the core: readers of frames, writers of VTK files, pictures, a command.

May import `stereosom`; never the reverse.
"""
